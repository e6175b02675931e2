# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording.sample_folders import lost

from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.record import Record
from objreg_tools.recording.rosbag import messages
from objreg_tools.truth import MAX_GAP_NS, Truth, Truths, spread, summarise

MS = 1_000_000


def at(x: float, yaw: float = 0.0) -> np.ndarray:
    return pose(rotation_from_vector(np.array([0, 0, yaw])), np.array([x, 0.0, 0.0]))


def closure(T_from_to: np.ndarray, from_ns: int = 0, to_ns: int = 100 * MS) -> LoopClosure:
    return LoopClosure(from_ns=from_ns, to_ns=to_ns, T_from_to=T_from_to, covariance=np.eye(6), labels=())


def test_the_truth_between_two_moments_is_the_relative_pose() -> None:
    truth = Truth([(0, at(1, 0.3)), (100 * MS, at(2, 0.5))])
    T_from_to = truth.between(0, 100 * MS)
    assert T_from_to is not None and np.allclose(T_from_to, inverse(at(1, 0.3)) @ at(2, 0.5))
    assert truth.error(closure(T_from_to)) == pytest.approx((0, 0), abs=1e-6)


def test_an_error_is_given_in_degrees_and_centimetres() -> None:
    truth = Truth([(0, at(0)), (100 * MS, at(1))])
    assert truth.error(closure(at(1.02, np.radians(2)))) == pytest.approx((2, 2))


def test_a_closure_the_other_way_round_is_wrong() -> None:
    truth = Truth([(0, at(0)), (100 * MS, at(1))])
    error = truth.error(closure(at(-1)))
    assert error is not None and error[1] == pytest.approx(200)


def of_two() -> Truths:
    """One robot drives away from the origin; the other stands to its side, turned, by the same clock."""
    return Truths({"a": Truth([(0, at(0)), (100 * MS, at(1))]), "b": Truth([(0, at(5, 0.5)), (100 * MS, at(5, 0.5))])})


def tie(T_from_to: np.ndarray, from_robot: str, to_robot: str, to_ns: int = 100 * MS) -> LoopClosure:
    return replace(closure(T_from_to, to_ns=to_ns), from_robot=from_robot, to_robot=to_robot)


def test_a_constraint_between_two_robots_has_the_error_of_both_paths() -> None:
    T_a_b = inverse(at(0)) @ at(5, 0.5)
    assert of_two().error(tie(T_a_b, "a", "b")) == pytest.approx((0, 0), abs=1e-6)
    turned = of_two().error(tie(T_a_b, "b", "a"))
    assert turned is not None and turned[1] > 100


def test_a_constraint_of_one_robot_is_judged_by_its_own_path() -> None:
    assert of_two().error(tie(at(1.02), "a", "a")) == pytest.approx((0, 2), abs=1e-6)
    assert of_two().error(tie(at(0.02), "b", "b")) == pytest.approx((0, 2), abs=1e-6)


def test_between_robots_the_truth_gives_nothing_beyond_either_path() -> None:
    late = tie(at(1), "a", "b", to_ns=900 * MS)
    assert of_two().error(late) is None and of_two().errors([late, tie(at(1), "a", "a")]) == [pytest.approx((0, 0))]


def test_a_robot_without_a_truth_is_refused_by_its_name() -> None:
    with pytest.raises(ValueError, match="expected one of a, b, got ''"):
        of_two().error(closure(at(1)))


def test_errors_are_of_the_closures_that_the_truth_covers() -> None:
    truth = Truth([(0, at(0)), (100 * MS, at(1))])
    assert truth.errors([closure(at(1)), closure(at(1), to_ns=900 * MS)]) == [pytest.approx((0, 0), abs=1e-6)]


def test_between_two_poses_the_truth_is_interpolated() -> None:
    truth = Truth([(0, at(0, 0)), (100 * MS, at(1, 0.4))])
    T = truth.at(25 * MS)
    assert T is not None and np.allclose(T, at(0.25, 0.1))


def test_over_more_than_the_longest_gap_the_truth_is_not_interpolated() -> None:
    assert Truth([(0, at(0)), (MAX_GAP_NS, at(1))]).at(MAX_GAP_NS // 2) is not None
    assert Truth([(0, at(0)), (MAX_GAP_NS + 1, at(1))]).at(MAX_GAP_NS // 2) is None


@pytest.mark.parametrize("stamp_ms", [-1, 101, 250, 401])
def test_where_the_truth_says_nothing_there_is_no_error(stamp_ms: int) -> None:
    truth = Truth([(0, at(0)), (100 * MS, at(1)), (400 * MS, at(2))])
    assert truth.at(stamp_ms * MS) is None
    assert truth.error(closure(at(0), 0, stamp_ms * MS)) is None


def test_a_truth_without_poses_gives_nothing() -> None:
    assert Truth([]).error(closure(at(0))) is None


def test_a_pose_of_an_earlier_time_is_left_out() -> None:
    truth = Truth([(100, at(1)), (50, at(5)), (100, at(6)), (200, at(2))])
    assert truth.stamps_ns == [100, 200]


@pytest.mark.parametrize("stray", [0, 1, 3, 4])
@pytest.mark.parametrize("leap_s", [5, 24 * 3600])
def test_a_stamp_that_leaps_ahead_alone_leaves_out_no_other_pose(stray: int, leap_s: int) -> None:
    stamps = [100 * MS * i + (i == stray) * leap_s * 10**9 for i in range(6)]
    truth = Truth([(stamp_ns, at(i)) for i, stamp_ns in enumerate(stamps)])
    assert truth.stamps_ns == [100 * MS * i for i in range(6) if i != stray]
    assert truth.notes == (
        "1 of 6 poses of the ground truth are left out: their stamps do not increase, or leap ahead alone",
    )


def test_a_stamp_that_leaps_back_alone_leaves_out_no_other_pose() -> None:
    truth = Truth([(stamp_s * 10**9, at(0)) for stamp_s in (100, 0, 101, 102)])
    assert truth.stamps_ns == [100 * 10**9, 101 * 10**9, 102 * 10**9] and "1 of 4 poses" in truth.notes[0]


def test_where_time_begins_anew_the_first_run_stays() -> None:
    truth = Truth([(stamp_s * 10**9, at(0)) for stamp_s in (0, 2, 4, 0, 2, 4, 6)])
    assert [stamp_ns // 10**9 for stamp_ns in truth.stamps_ns] == [0, 2, 4, 6] and "3 of 7 poses" in truth.notes[0]


def test_a_truth_in_order_has_no_note() -> None:
    assert Truth([(0, at(0)), (10**12, at(1))]).notes == ()


def test_a_dropout_of_the_truth_is_passed_over_and_counted(tmp_path: Path) -> None:
    records = [Record.of("/gt", messages.pose_stamped(at(i), i * 50 * MS, "world"), i * 50 * MS) for i in range(4)]
    write_rosbag2(tmp_path / "bag", [records[0], lost(records[1]), lost(records[2], float("nan")), records[3]])
    with open_recording(tmp_path / "bag") as recording:
        truth = Truth.of(recording, "/gt")
    assert truth.stamps_ns == [0, 150 * MS]
    assert len(truth.notes) == 1 and "2 of 4 poses of the ground truth /gt are none" in truth.notes[0]


def test_the_length_of_the_path_is_known() -> None:
    assert Truth([(0, at(0)), (1, at(1)), (2, at(-0.5))]).length == pytest.approx(2.5)
    assert Truth([]).length == 0


def test_a_summary_counts_what_is_strict_loose_and_false() -> None:
    errors = [(1.0, 1.0), (3.0, 5.0), (3.1, 5.0), (5.0, 10.0), (6.0, 6.0), (8.0, 15.0), (8.1, 1.0), (1.0, 15.1)]
    summary = summarise(errors)
    assert (summary["strict"], summary["loose"], summary["false"], summary["count"]) == (2, 4, 2, 8)
    assert summary["rotation_deg"]["max"] == 8.1 and summary["translation_cm"]["median"] == 5.5


def test_a_summary_of_nothing_has_no_numbers() -> None:
    summary = summarise([])
    assert summary["count"] == 0 and summary["rotation_deg"] == {"median": None, "p95": None, "max": None}


def test_a_spread_is_the_median_the_95th_percentile_and_the_largest() -> None:
    assert spread(range(101)) == {"median": 50.0, "p95": 95.0, "max": 100.0}
