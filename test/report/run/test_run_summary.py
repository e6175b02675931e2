# SPDX-License-Identifier: Apache-2.0
"""What a summary knows of a run."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.truth import Truth
from report.runs import COUNT, TRUE, TRUTH, summary, tracked, with_a_stray


def test_closures_bend_the_way_back_to_the_truth() -> None:
    tracks = RunSummary.of("walk", summary(), TRUTH).tracks()
    before, after = (np.sqrt(np.mean(error**2)) for error in (tracks.odometry_error, tracks.corrected_error))
    assert after < 0.5 * before
    np.testing.assert_allclose(np.linalg.norm(tracks.corrected - tracks.true, axis=1), tracks.corrected_error)


def test_a_false_closure_is_known_by_the_truth_and_pruned_by_the_map() -> None:
    run = RunSummary.of("walk", summary(false=True), TRUTH)
    assert [run.is_false(closure) for closure in run.closures] == [False] * 4 + [True]
    assert run.pruned == run.closures[-1:]


def test_every_frame_is_on_the_way_of_a_camera_at_rest_too() -> None:
    written = summary()
    for row in written["glimpses"]:
        row["T_odom_camera"] = TRUE[0].tolist()
    tracks = RunSummary.of("rest", written, TRUTH).tracks()
    assert list(tracks.stamps_ns) == TRUTH.stamps_ns
    assert tracks.odometry.shape == tracks.corrected.shape == (COUNT, 3)


@pytest.mark.parametrize("key", ["constraints", "glimpses", "refusals"])
@pytest.mark.parametrize("value", [3, [3], [{}], [{"stamp_ns": "x", "from_ns": 1}], "ab"])
def test_json_of_another_form_is_refused_by_the_name_of_its_run(key: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"^walk: expected {key} as `objreg offline --json` writes them, got "):
        RunSummary.of("walk", {**summary(), key: value}, TRUTH)


ODD = [
    ("constraints", "to_ns", 1e300),
    ("constraints", "from_ns", float("inf")),
    ("constraints", "evidence", {"score": "high"}),
    ("refusals", "from_ns", 1 << 63),
    ("refusals", "detail", 5),
    ("refusals", "T_from_to", [1.0]),
    ("refusals", "evidence", {"score": None}),
    ("glimpses", "stamp_ns", 1 << 70),
    ("glimpses", "objects", [["cup", 1.0]]),
    ("glimpses", "objects", [["cup", [0.0, 1.0]]]),
    ("glimpses", "objects", [["cup", [0.0, 1.0, float("nan")]]]),
]


@pytest.mark.parametrize(("key", "field", "value"), ODD)
def test_a_number_that_no_run_has_is_refused_by_the_name_of_its_run(key: str, field: str, value: object) -> None:
    written = summary()
    written[key][1][field] = value
    with pytest.raises(ValueError, match=f"^walk: expected {key} as `objreg offline --json` writes them, got "):
        RunSummary.of("walk", written, TRUTH)


def test_a_refused_pose_that_is_not_finite_is_none_to_look_at() -> None:
    written = summary()
    written["refusals"][1]["T_from_to"] = np.full((4, 4), np.inf).tolist()
    assert RunSummary.of("walk", written, TRUTH).refusals[1].T_from_to is None


@pytest.mark.parametrize("pose", [[[float("nan")] * 4] * 4, np.eye(3).tolist(), np.zeros((4, 4)).tolist()])
def test_a_frame_without_a_rigid_pose_is_refused_by_the_name_of_its_run(pose: list[list[float]]) -> None:
    written = summary()
    written["glimpses"][3]["T_odom_camera"] = pose
    with pytest.raises(ValueError, match=r"^walk: expected glimpses as `objreg offline --json` writes them, got "):
        RunSummary.of("walk", written, TRUTH)


def test_without_truth_nothing_is_false_and_there_are_no_errors() -> None:
    run = RunSummary.of("walk", summary(false=True), Truth([]))
    assert not any(run.is_false(closure) for closure in run.closures)
    assert run.tracks().true is None and run.tracks().corrected_error is None


def test_without_odometry_there_are_no_tracks_and_no_object_map() -> None:
    written = summary()
    for row in written["glimpses"]:
        row["T_odom_camera"] = None
    run = RunSummary.of("walk", written, TRUTH)
    assert run.tracks() is None and run.objects() == []


def test_one_object_is_one_place_in_the_map_and_several_by_odometry() -> None:
    seen = [row for row in RunSummary.of("walk", summary(), TRUTH).objects() if row[0] == "book"]
    by_odometry, in_map = (np.linalg.norm(np.std([row[i] for row in seen], axis=0)) for i in (1, 2))
    assert in_map < 0.5 * by_odometry


def test_frames_whose_time_does_not_advance_are_left_out_and_counted() -> None:
    written = summary()
    again = [dict(written["glimpses"][k]) for k in (119, 7, 0)]
    early = {**again[0], "stamp_ns": -5}
    run = RunSummary.of("walk", {**written, "glimpses": [*written["glimpses"], *again, early]}, TRUTH)
    once = RunSummary.of("walk", written, TRUTH)
    assert (once.left_out, run.left_out) == (0, 4)
    np.testing.assert_array_equal(run.tracks().corrected, once.tracks().corrected)
    assert len(run.objects()) == len(once.objects())


def test_an_older_json_without_frames_is_read_all_the_same() -> None:
    written = {key: value for key, value in summary().items() if key not in ("glimpses", "refusals")}
    run = RunSummary.of("walk", written, TRUTH)
    assert len(run.closures) == 4 and run.tracks() is None
    assert run.seconds(run.closures[0].to_ns) == pytest.approx(6.0)


def test_labels_read_as_words() -> None:
    written = summary()
    written["constraints"][0]["labels"] = ["cereal_box"]
    written["glimpses"][0] |= {"labels": ["soda_can"], "objects": [["soda_can", [0.0, 0.0, 1.0]]]}
    run = RunSummary.of("walk", written, TRUTH)
    assert run.closures[0].labels == ("cereal box",) and run.glimpses[0].labels == ("soda can",)
    assert run.glimpses[0].objects[0][0] == "soda can"


def test_the_pose_that_was_refused_is_kept_where_there_was_one() -> None:
    written = summary()
    written["refusals"][1]["T_from_to"] = np.eye(4).tolist()
    refusals = RunSummary.of("walk", written, TRUTH).refusals
    assert refusals[0].T_from_to is None
    np.testing.assert_array_equal(refusals[1].T_from_to, np.eye(4))


def test_without_the_solver_the_way_is_that_of_odometry_and_the_run_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gtsam", None)
    run = RunSummary.of("walk", summary(), TRUTH)
    assert "expected gtsam" in run.map.unsolved and not run.pruned
    tracks = run.tracks()
    np.testing.assert_allclose(tracks.corrected, tracks.odometry, atol=1e-3)


@pytest.mark.parametrize("years", [-54, 3])
def test_a_frame_of_another_time_does_not_stretch_the_run_and_is_counted(years: int) -> None:
    run = RunSummary.of("walk", with_a_stray(years * 31_536_000 * 10**9), TRUTH)
    assert run.stretch_ns == (0, TRUTH.stamps_ns[-1]) and run.seconds(10**9) == 1.0
    assert run.out_of_time == {"frames": 1, "refusals": 1}
    assert RunSummary.of("walk", summary(), TRUTH).out_of_time == {}


def test_a_run_with_a_short_rest_is_one_stretch() -> None:
    written = summary()
    for row in written["glimpses"][60:]:
        row["stamp_ns"] += 3000 * 10**9
    run = RunSummary.of("walk", written, TRUTH)
    assert run.out_of_time == {} and run.stretch_ns[1] > 3000 * 10**9


def test_our_own_tracking_is_corrected_as_odometry_is_and_named_as_what_it_is() -> None:
    run, usual = RunSummary.of("walk", tracked(), TRUTH), RunSummary.of("walk", summary(), TRUTH)
    tracks, trajectory = run.tracks(), run.trajectory()
    assert list(tracks.lines) == ["true", "tracked", "corrected"]
    assert trajectory["of"] == "tracked" and (trajectory["frames"], trajectory["sessions"]) == (COUNT, 1)
    assert trajectory["error_cm"]["after"] < 0.5 * trajectory["error_cm"]["before"]
    assert usual.trajectory()["error_cm"]["before"] == pytest.approx(trajectory["error_cm"]["before"])
    assert len(run.objects()) == len(usual.objects()) > 0


def test_of_a_track_that_was_lost_the_largest_part_is_on_the_map() -> None:
    written = tracked(begins=45)  # closures tie 40 to 100, but one alone ties no session
    written["constraints"] = [row for row in written["constraints"] if row["from_ns"] == 40 * 100_000_000]
    run = RunSummary.of("walk", written, TRUTH)
    trajectory = run.trajectory()
    assert (trajectory["frames"], trajectory["frames_apart"], trajectory["sessions_apart"]) == (75, 45, 1)
    assert run.left_out == 0 and len(run.tracks().corrected) == 75
    whole = RunSummary.of("walk", tracked(begins=45), TRUTH).trajectory()
    assert (whole["frames"], whole["sessions"], whole["frames_apart"]) == (COUNT, 2, 0)


def test_without_an_order_to_track_the_track_is_no_map() -> None:
    run = RunSummary.of("walk", {**tracked(), "odometry": None}, TRUTH)
    assert run.tracks() is None and run.trajectory() is None and len(run.tracked_trajectory()[0]) == COUNT
