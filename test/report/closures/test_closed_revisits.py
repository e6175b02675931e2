# SPDX-License-Identifier: Apache-2.0
"""How often a camera came back, without truth, on walks of which it is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_tools.report.closures.closed_revisits import ClosedRevisits, Walk
from objreg_tools.report.run.rows import Glimpse
from objreg_tools.truth import Truth

SECOND = 1_000_000_000
RATE = 5  # frames a second
CUP = np.array([0.0, 0.0, 1.5])  # m, before a camera that looks along z


def looking(degrees: float) -> np.ndarray:
    """The pose of a camera that stands and is turned aside by so much."""
    return pose(rotation_from_vector(np.array([0.0, np.radians(degrees), 0.0])), np.zeros(3))


def turned(stays: Sequence[tuple[float, float]]) -> list[float]:
    """The turn at each frame of a camera that looks for so many seconds by so many degrees aside."""
    return [degrees for seconds, degrees in stays for _ in range(round(seconds * RATE))]


def glimpses(turns: Sequence[float], posed: bool = True) -> list[Glimpse]:
    frames = []
    for k, degrees in enumerate(turns):
        T, sees = looking(degrees), abs(degrees) < 30
        seen = [("cup", transform(inverse(T), CUP))] if sees else []
        labels = ("cup",) if sees else ()
        frames.append(Glimpse(k * SECOND // RATE, T if posed else None, labels, None, tuple(seen)))
    return frames


def constraint(from_s: float, to_s: float, **other: str) -> LoopClosure:
    """Of a camera that looks the same way at both times."""
    ends = {"from_ns": round(from_s * SECOND), "to_ns": round(to_s * SECOND)}
    return LoopClosure(**ends, T_from_to=np.eye(4), covariance=np.eye(6) * 1e-4, labels=("cup",), **other)


AWAY = turned([(6, 0), (4, 90), (6, 0)])  # leaves from 6 to 10 s
TWICE = turned([(6, 0), (4, 90), (6, 0), (4, 90), (6, 0)])  # and from 16 to 20 s


def found(closures: Sequence[LoopClosure], turns: Sequence[float], posed: bool = True) -> ClosedRevisits:
    return ClosedRevisits.of(closures, Walk(glimpses(turns, posed), by_tracking=False))


def test_twelve_constraints_of_one_return_are_one_revisit() -> None:
    closures = [constraint(a, b) for a in (0.4, 2.0, 4.0, 5.4) for b in (10.6, 12.4, 15.0)]
    of = found(closures, AWAY)
    assert len(of.revisits) == 1 and of.closing == 12 and not of.stayed and not of.unknown
    assert of.text == "1 revisit, closed by 12 constraints" and of.count == 1


def test_two_returns_are_two_revisits_whatever_they_are_tied_to() -> None:
    closures = [constraint(1, 11), constraint(2, 14), constraint(1, 21), constraint(12, 22), constraint(14, 24)]
    of = found(closures, TWICE)
    assert [len(revisit) for revisit in of.revisits] == [2, 3]
    assert of.text == "2 revisits, closed by 5 constraints"


def test_a_camera_that_stays_closes_no_revisit() -> None:
    of = found([constraint(k, k + 3) for k in range(8)], turned([(12, 0)]))
    assert of.revisits == () and len(of.stayed) == 8
    assert of.text == "the camera never left: 8 constraints between keyframes of one place, 0 revisits"
    assert "1 constraint between" in found([constraint(0, 4)], turned([(12, 0)])).text


def test_what_is_tied_within_a_stay_is_counted_beside_its_revisits() -> None:
    of = found([constraint(0, 3), constraint(1, 11), constraint(11, 14)], AWAY)
    assert of.text == "1 revisit, closed by 1 constraint (2 more within one stay)"


def test_a_glance_aside_of_less_than_a_second_is_no_leaving() -> None:
    assert found([constraint(1, 11)], turned([(6, 0), (0.8, 90), (6, 0)])).stayed == (0,)
    assert found([constraint(1, 11)], turned([(6, 0), (1.4, 90), (6, 0)])).closing == 1


def test_odometry_that_drifts_away_does_not_make_a_camera_leave() -> None:
    frames = [
        Glimpse(k * SECOND // RATE, looking(0.8 * k), ("cup",), None, (("cup", CUP),)) for k in range(12 * RATE)
    ]  # 47 degrees in the end, while it truly stays
    assert ClosedRevisits.of([constraint(0, 11)], Walk(frames, by_tracking=False)).closing == 0


def test_without_poses_the_detections_must_lack_the_place_for_three_seconds() -> None:
    assert found([constraint(1, 14)], AWAY, posed=False).closing == 1
    of = found([constraint(1, 11)], turned([(6, 0), (2, 90), (6, 0)]), posed=False)
    assert of.unknown == (0,) and "it is not known whether the camera had left" in of.text


def test_truth_gives_the_poses_where_a_run_has_none() -> None:
    turns = turned([(6, 0), (2, 90), (6, 0)])
    truth = Truth((k * SECOND // RATE, looking(degrees)) for k, degrees in enumerate(turns))
    assert ClosedRevisits.of([constraint(1, 11)], Walk(glimpses(turns, posed=False), False, truth=truth)).closing == 1


def test_a_place_of_an_earlier_run_or_of_another_camera_was_left() -> None:
    before = constraint(-500, 3)
    other = constraint(1, 3, from_frame_id="front", to_frame_id="rear")
    assert found([before, other], turned([(12, 0)])).revisits == ((0, 1),)


def test_a_run_without_frames_does_not_know() -> None:
    of = ClosedRevisits.of([constraint(0, 9)], Walk([], False))
    assert of.unknown == (0,) and of.count is None
    none = ClosedRevisits.of([], Walk([], False))
    assert none.text == "" and none.count == 0


@pytest.mark.parametrize(("field_deg", "left"), [((60.0, 45.0), True), ((120.0, 90.0), False)])
def test_a_wide_camera_still_sees_what_a_narrow_one_has_left(field_deg: tuple[float, float], left: bool) -> None:
    walk = Walk(glimpses(turned([(6, 0), (4, 45), (6, 0)])), False, field_deg)
    assert walk.left(constraint(1, 12)) is left
