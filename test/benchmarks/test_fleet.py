# SPDX-License-Identifier: Apache-2.0
"""Tests of what robots saw that another had seen before, along a wall that all look at."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose
from objreg_tools.report.run.revisits import SeenPlace
from objreg_tools.truth import Truth, Truths

SECOND = 10**9
CAMERA = Intrinsics(fx=40.0, fy=40.0, cx=19.5, cy=14.5, width=40, height=30)
WAYS = {
    "a": [(0, 0.0), (1, 0.2), (2, 5.0)],
    "b": [(0, 20.0), (10, 0.1), (11, 0.2), (20, 5.1), (30, 40.0)],
    "c": [(1, 0.1), (31, 40.1)],
}
"""Seconds and metres along the wall, of the keyframes of each robot."""


def wall(seconds: float, x: float) -> SeenPlace:
    """What a camera at (x, 0, 0) sees of the wall z = 2 m."""
    v, u = np.mgrid[:30, :40]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    view = View(xyz=(2.0 * rays).astype(np.float32), grey=None, intrinsics=CAMERA)
    return SeenPlace(int(seconds * SECOND), view, pose(np.eye(3), np.array([x, 0.0, 0.0])))


@pytest.fixture
def seen() -> dict[str, list[SeenPlace]]:
    return {robot: [wall(*at) for at in way] for robot, way in WAYS.items()}


@pytest.fixture
def truths(seen: dict[str, list[SeenPlace]]) -> Truths:
    return Truths({robot: Truth((m.stamp_ns, m.T_world_camera) for m in moments) for robot, moments in seen.items()})


def tie(
    seen: dict[str, list[SeenPlace]], one: tuple[str, int], other: tuple[str, int], off: float = 0.0
) -> LoopClosure:
    """A constraint between two keyframes by robot and number, ``off`` metres wrong."""
    a, b = (seen[robot][k] for robot, k in (one, other))
    T = inverse(a.T_world_camera) @ b.T_world_camera
    T[0, 3] += off
    fields: dict[str, Any] = {"covariance": np.eye(6), "labels": (), "from_robot": one[0], "to_robot": other[0]}
    return LoopClosure(from_ns=a.stamp_ns, to_ns=b.stamp_ns, T_from_to=T, **fields)


def test_a_meeting_is_a_keyframe_that_saw_what_another_robot_had_seen_before(seen: dict[str, list[SeenPlace]]) -> None:
    from fleet import meetings

    found = [(m.earlier, m.later, m.revisit.to_ns // SECOND) for m in meetings(seen)]
    expected = [
        ("a", "b", 10),
        ("a", "b", 11),
        ("a", "b", 20),
        ("c", "b", 10),
        ("c", "b", 11),
        ("a", "c", 1),
        ("b", "c", 31),
    ]
    assert sorted(found) == sorted(expected)


def test_meetings_that_follow_each_other_are_one_stretch(seen: dict[str, list[SeenPlace]]) -> None:
    from fleet import meetings, stretches

    spans = [
        (part[0].earlier, part[0].later, [m.revisit.to_ns // SECOND for m in part])
        for part in stretches(meetings(seen))
    ]
    assert spans == [("a", "b", [10, 11]), ("a", "b", [20]), ("c", "b", [10, 11]), ("a", "c", [1]), ("b", "c", [31])]


def test_a_right_constraint_closes_its_keyframe_and_its_stretch(
    seen: dict[str, list[SeenPlace]], truths: Truths
) -> None:
    from fleet import judged, meetings

    ties = [tie(seen, ("a", 0), ("b", 1)), tie(seen, ("c", 1), ("b", 4)), tie(seen, ("a", 2), ("b", 3), off=1.0)]
    figures = judged(meetings(seen), [*ties, tie(seen, ("a", 0), ("a", 1))], truths)
    assert (figures["constraints"], figures["true"], figures["false"]) == (3, 2, 1)
    assert figures["stretches"] == {"closed": 2, "of": 5}
    assert figures["keyframes"] == {"closed": 3, "of": 7}  # two of them within a second of one constraint
    assert figures["view_change"]["0-30"] == figures["keyframes"] and figures["view_change"]["60-120"]["of"] == 0
    assert figures["robots"]["a-b"] == {"closed": 1, "of": 2} and figures["robots"]["c-b"] == {"closed": 0, "of": 1}


def test_without_constraints_nothing_is_closed(seen: dict[str, list[SeenPlace]], truths: Truths) -> None:
    from fleet import judged, meetings

    figures = judged(meetings(seen), [], truths)
    assert figures["stretches"] == {"closed": 0, "of": 5} and figures["false"] == 0
