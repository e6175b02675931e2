# SPDX-License-Identifier: Apache-2.0
"""The map of a run whose track was lost and found again by closures."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from objreg_mapper.params import MapperParams
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.report.run.camera_map import CameraMap, TrackedFrame, with_sessions
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from report.runs import COUNT, STEP_NS, TRUE

DRIFT = pose(rotation_from_vector(np.array([0.0, 0.0, 0.004])), np.array([0.002, 0.0, 0.0]))
PARAMS = MapperParams.of_tracking()


def tracked(*begins: int, drift: np.ndarray = DRIFT) -> list[TrackedFrame]:
    """The circle that is walked twice, tracked with drift; a session begins at each of these frames."""
    frames: list[TrackedFrame] = []
    for session, (first, end) in enumerate(pairwise([*begins, COUNT])):
        T = np.eye(4)
        for k in range(first, end):
            T = T if k == first else T @ inverse(TRUE[k - 1]) @ TRUE[k] @ drift
            frames.append(TrackedFrame(k * STEP_NS, session, T))
    return frames


def closure(a: int, b: int, metres: float = 0.0) -> LoopClosure:
    T = inverse(TRUE[a]) @ TRUE[b]
    T[0, 3] += metres
    covariance = np.diag([0.02**2] * 3 + [0.01**2] * 3)
    return LoopClosure(from_ns=a * STEP_NS, to_ns=b * STEP_NS, T_from_to=T, covariance=covariance, labels=("cup",))


def mapped(frames: list[TrackedFrame], *closures: LoopClosure) -> CameraMap:
    return CameraMap.of(frames, with_sessions(closures, frames), PARAMS)


def true_of(made: CameraMap) -> list[np.ndarray]:
    return [TRUE[frame.stamp_ns // STEP_NS] for frame in made.frames]


def errors_m(made: CameraMap) -> tuple[float, float]:
    true = true_of(made)
    before = absolute_trajectory_error([frame.T_map_camera_before for frame in made.frames], true)
    return before, absolute_trajectory_error([frame.T_map_camera for frame in made.frames], true)


def test_closures_correct_one_session() -> None:
    made = mapped(tracked(0), *(closure(k, k + 60) for k in (5, 20, 40, 55)))
    before, after = errors_m(made)
    assert (made.sessions, made.sessions_apart, made.frames_apart) == (1, 0, 0) and len(made.frames) == COUNT
    assert after < 0.5 * before
    np.testing.assert_array_equal(made.frames[0].T_map_camera_before, np.eye(4))


def test_sessions_that_closures_tie_are_in_the_frame_of_the_longest() -> None:
    frames = tracked(0, 30)  # the second one is the longer
    made = mapped(frames, *(closure(k, k + 60) for k in (5, 15, 25)))
    assert (made.sessions, made.frames_apart, len(made.frames)) == (2, 0, COUNT)
    assert [frame.stamp_ns for frame in made.frames] == [frame.stamp_ns for frame in frames]
    np.testing.assert_allclose(made.frames[30].T_map_camera, np.eye(4), atol=1e-6)
    assert errors_m(made)[1] < 0.1
    assert made.keyframes() > 10


def test_what_nothing_ties_stays_apart_and_is_counted() -> None:
    made = mapped(tracked(0, 20, 25, 80), closure(30, 90), closure(35, 95))
    assert made.sessions == 2 and made.sessions_apart == 2 and made.frames_apart == 25
    assert {frame.stamp_ns // STEP_NS for frame in made.frames} == set(range(25, COUNT))


def test_one_closure_alone_ties_no_session() -> None:
    made = mapped(tracked(0, 70), closure(20, 80))
    assert (made.sessions, made.sessions_apart, len(made.frames)) == (1, 1, 70)


def test_the_largest_part_counts_though_the_longest_session_is_alone() -> None:
    made = mapped(tracked(0, 50, 85), closure(55, 115), closure(58, 118), closure(52, 112))
    assert (made.sessions, made.frames_apart) == (2, 50)
    assert min(frame.stamp_ns for frame in made.frames) == 50 * STEP_NS


def test_a_closure_that_leads_farther_than_the_camera_went_is_pruned() -> None:
    made = mapped(tracked(0), closure(0, 2, metres=40.0))
    assert [c.to_ns for c in made.pruned] == [2 * STEP_NS]
    np.testing.assert_allclose(made.frames[-1].T_map_camera, made.frames[-1].T_session_camera, atol=2e-3)


def test_sessions_of_one_frame_and_no_frames_at_all_make_a_map_too() -> None:
    assert CameraMap.of([], ()).frames == ()
    made = mapped([TrackedFrame(k, k, np.eye(4)) for k in range(50)])
    assert (len(made.frames), made.sessions_apart, made.frames_apart) == (1, 49, 49)


def test_without_the_solver_the_track_is_as_it_is_and_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gtsam", None)
    made = mapped(tracked(0, 70), closure(20, 80), closure(25, 85))
    assert "expected gtsam" in made.unsolved and (made.sessions, len(made.frames)) == (1, 70)
    np.testing.assert_allclose(made.frames[-1].T_map_camera, made.frames[-1].T_session_camera, atol=2e-3)


def test_closures_of_one_robot_are_on_its_map_by_whatever_name_and_those_between_robots_are_not() -> None:
    ties = [closure(k, k + 60) for k in (5, 20, 40, 55)]
    named = [replace(tie, from_robot="a", to_robot="a") for tie in ties]
    between = [replace(tie, from_robot="a", to_robot="b") for tie in ties]
    assert errors_m(mapped(tracked(0), *named)) == pytest.approx(errors_m(mapped(tracked(0), *ties)))
    before, after = errors_m(mapped(tracked(0), *between))
    assert before == pytest.approx(after)
    lie = replace(closure(5, 65, metres=30.0), from_robot="a", to_robot="a")
    (pruned,) = mapped(tracked(0), *named, lie).pruned
    assert pruned.from_robot == "a" and pruned.T_from_to[0, 3] == lie.T_from_to[0, 3]
