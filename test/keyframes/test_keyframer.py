# SPDX-License-Identifier: Apache-2.0
"""Keyframer: when frames become a keyframe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import CAMERA, SECOND, box, frame, moved, scene_view

from objreg_ros.data.frames import Frame, View
from objreg_ros.geometry import inverse, is_rigid, pose, rotation_from_vector
from objreg_ros.keyframes.frame_window import Clock, FrameWindow, SessionNumbers
from objreg_ros.keyframes.keyframer import Keyframer
from objreg_ros.registrar.params import RegistrarParams

PARAMS = RegistrarParams(keyframe_translation=0.1, keyframe_rotation=10.0, keyframe_seconds=1.0)
CUP = (box("cup", (0, 0, 1)),)
DOWN = np.array([0.0, 1.0, 0.0])  # of a camera that is level


def _run(keyframer: Keyframer, frames: list[Frame]) -> list[FrameWindow]:
    ended = [keyframer.add_frame(item) for item in frames] + [keyframer.finish_window()]
    return [window for window in ended if window is not None]


def blind(seconds: float) -> Frame:
    """A frame of which nothing says where it was taken."""
    nothing = np.full((120, 160, 3), np.nan, np.float32)
    return frame(seconds, CUP, None, View(xyz=nothing, grey=None, intrinsics=CAMERA))


def test_a_moving_camera_makes_a_keyframe_each_time_it_has_moved_enough() -> None:
    frames = [frame(0.1 * i, CUP, moved(0.03 * i)) for i in range(13)]
    windows = _run(Keyframer(PARAMS), frames)
    assert [round(s.T_session_first[0, 3], 2) for s in windows] == [0.0, 0.12, 0.24, 0.36]
    assert [len(s.frames) for s in windows] == [4, 4, 4, 1]
    assert np.allclose(windows[1].T_first_frame[-1], moved(0.09))


def test_a_keyframe_that_has_all_its_frames_is_handed_over_once_and_before_its_end() -> None:
    keyframer = Keyframer(PARAMS)
    ended = [keyframer.add_frame(frame(0.1 * i, CUP, moved(0.03 * i))) for i in range(8)]
    assert [i for i, window in enumerate(ended) if window is not None] == [3, 7]
    assert keyframer.finish_window() is None


def test_a_keyframe_that_lacks_frames_waits_for_its_end() -> None:
    keyframer = Keyframer(PARAMS)
    ended = [keyframer.add_frame(frame(0.3 * i, CUP, moved(0.03 * min(i, 2)))) for i in range(5)]
    assert [None if window is None else len(window.frames) for window in ended] == [None, None, None, None, 3]


def test_a_camera_that_rests_makes_one_keyframe_until_something_new_comes() -> None:
    rest = [frame(0.2 * i, CUP, np.eye(4)) for i in range(20)]
    new = [frame(4.0 + 0.2 * i, (*CUP, box("book", (0.5, 0, 1))), np.eye(4)) for i in range(20)]
    windows = _run(Keyframer(PARAMS), rest + new)
    assert [len(s.frames[-1].objects) for s in windows] == [1, 2]


def test_frames_without_objects_make_no_keyframe() -> None:
    assert _run(Keyframer(PARAMS), [frame(0.1 * i, (), moved(0.1 * i)) for i in range(10)]) == []


def test_objects_without_points_make_no_keyframe() -> None:
    cup = CUP[0]
    nowhere = replace(cup, xyz=cup.xyz[:0], normals=cup.normals[:0], flags=cup.flags[:0], rgb=None)
    assert _run(Keyframer(PARAMS), [frame(0.1 * i, (nowhere,), moved(0.1 * i)) for i in range(10)]) == []


def swung(degrees: float) -> np.ndarray:
    return pose(rotation_from_vector(np.array([0.0, np.radians(degrees), 0.0])), np.zeros(3))


def test_a_camera_that_turns_fast_is_followed_in_one_session() -> None:
    poses = [swung(angle) for angle in (0, 7, 14, 21, 14, 6)]
    keyframer = Keyframer(PARAMS)
    for i, T in enumerate(poses):
        keyframer.add_frame(frame(0.1 * i, CUP, None, scene_view(T)))
        assert keyframer.tracked is not None and keyframer.tracked[0] == 0
        np.testing.assert_allclose(keyframer.tracked[1], T, atol=0.02)


def test_without_odometry_the_views_give_the_motion() -> None:
    frames = [frame(0.1 * i, CUP, None, scene_view(moved(0.03 * i))) for i in range(6)]
    windows = _run(Keyframer(PARAMS), frames)
    assert len(windows) == 2 and {s.session for s in windows} == {0}
    assert np.allclose(windows[1].T_session_first, moved(0.12), atol=0.005)


def test_where_the_newest_frame_is_in_its_session_is_known() -> None:
    keyframer = Keyframer(PARAMS)
    assert keyframer.tracked is None
    for k in range(5):
        keyframer.add_frame(frame(0.1 * k, CUP, None, scene_view(moved(0.03 * k))))
    assert keyframer.tracked is not None
    session, T_session_camera = keyframer.tracked
    assert session == 0 and np.allclose(T_session_camera, moved(0.12), atol=0.005)


def test_our_own_tracking_stays_rigid_however_long_it_is() -> None:
    keyframer, sway = Keyframer(PARAMS), 0.1 * np.sin(0.2 * np.arange(150))
    windows = _run(keyframer, [frame(0.1 * i, CUP, None, scene_view(moved(x))) for i, x in enumerate(sway)])
    assert {s.session for s in windows} == {0} and len(windows) > 10
    assert all(is_rigid(s.T_session_first, 1e-12) for s in windows)


def test_a_lost_track_and_a_jump_back_in_time_begin_a_new_session() -> None:
    sessions = [s.session for s in _run(Keyframer(PARAMS), [frame(0.0, CUP), blind(0.1)])]
    assert sessions == [0, 1]
    looped = [frame(5.0, CUP, np.eye(4)), frame(1.0, CUP, np.eye(4)), frame(1.1, CUP, np.eye(4))]
    assert [s.session for s in _run(Keyframer(PARAMS), looped)] == [0, 1]


def test_odometry_that_begins_anew_elsewhere_begins_a_new_session() -> None:
    away = pose(np.eye(3), np.array([0.9, 0.0, 0.0]))
    steps = [moved(0.03 * i) for i in range(20)]
    restarted = [frame(0.03 * i, CUP, T if i < 10 else away @ T) for i, T in enumerate(steps)]
    assert {s.session for s in _run(Keyframer(PARAMS), restarted)} == {0, 1}
    fast = PARAMS.replaced(max_speed=20.0)
    assert {s.session for s in _run(Keyframer(fast), restarted)} == {0}


def test_odometry_that_is_back_where_it_began_after_a_silence_begins_a_new_session() -> None:
    there = [frame(0.1 * i, CUP, moved(0.1 * i)) for i in range(10)]
    assert {s.session for s in _run(Keyframer(PARAMS), [*there, frame(60.0, CUP, moved(0.0))])} == {0, 1}
    assert {s.session for s in _run(Keyframer(PARAMS), [*there, frame(60.0, CUP, moved(0.2))])} == {0}


@pytest.mark.parametrize(("silence", "knows"), [(4.0, True), (30.0, False)])
def test_after_a_long_silence_nobody_knows_the_way_there_nor_which_way_things_fall(silence: float, knows: bool) -> None:
    there = [replace(frame(0.1 * k, CUP, moved(0.1 * k)), gravity=DOWN, gravity_confidence=1.0) for k in range(30)]
    back = replace(frame(2.9 + silence, CUP, moved(2.5)), gravity=DOWN, gravity_confidence=1.0)
    *_, before, after = _run(Keyframer(PARAMS), [*there, back])
    assert before.session == after.session
    assert (after.travelled - before.travelled < 1.0) is knows
    assert (after.frames[0].gravity_confidence > before.frames[0].gravity_confidence - 0.1) is knows


def test_a_frame_that_comes_late_or_twice_is_passed_over() -> None:
    frames = [frame(t, CUP, moved(0.03 * k)) for k, t in enumerate((5.0, 5.1, 5.0, 4.2, 5.1, 5.2, 5.3, 5.4, 5.5))]
    windows = _run(Keyframer(PARAMS), frames)
    assert {s.session for s in windows} == {0}
    stamps = [f.stamp_ns for s in windows for f in s.frames]
    assert stamps == sorted(set(stamps)) and min(stamps) == 5 * SECOND


def test_a_first_stamp_that_nobody_set_begins_no_clock() -> None:
    frames = [frame(at, CUP, moved(0.0)) for at in (0.0, 500.0, 500.1, 500.2)]
    unset, set_later = (s.clock for s in _run(Keyframer(PARAMS), frames))
    assert unset == Clock(0, 0) and set_later == Clock(500 * SECOND, 1)
    (from_zero,) = {s.clock for s in _run(Keyframer(PARAMS), [frame(0.1 * k, CUP, moved(0.03 * k)) for k in range(6)])}
    assert from_zero == Clock(0, 0)


def test_a_clock_runs_until_time_goes_back() -> None:
    frames = [frame(t, CUP, moved(t)) for t in (5.0, 6.0)] + [frame(7.0, CUP, None, scene_view(moved(9.0)))]
    frames += [frame(t, CUP, moved(t)) for t in (1.0, 2.0)]
    clocks = [s.clock for s in _run(Keyframer(PARAMS, SessionNumbers(4)), frames)]
    assert clocks[0] == Clock(5 * SECOND, 4) and clocks[-1].began_ns == SECOND
    assert clocks == sorted(clocks, key=lambda clock: clock.session)
    assert len(set(clocks)) == 2 and clocks[-1].session > 4


def test_odometry_that_appears_begins_its_own_session() -> None:
    windows = _run(Keyframer(PARAMS), [frame(0.0, CUP), frame(0.1, CUP, moved(7.0)), frame(0.2, CUP, moved(7.5))])
    assert [s.session for s in windows] == [0, 1, 1]
    assert np.allclose(windows[-1].T_session_first, moved(7.5))


def test_a_gap_in_the_odometry_is_bridged_by_the_views() -> None:
    poses = [moved(5.0 + 0.03 * i) for i in range(6)]
    frames = [
        frame(0.1 * i, CUP, None if i in (2, 4) else poses[i], scene_view(moved(0.03 * i))) for i in range(len(poses))
    ]
    windows = _run(Keyframer(PARAMS), frames)
    assert {s.session for s in windows} == {0}
    assert np.allclose(windows[-1].T_session_first, moved(5.12), atol=0.005)


def test_a_keyframe_that_begins_in_a_gap_is_of_our_own_tracking_and_ends_where_odometry_comes_back() -> None:
    frames = [frame(0.1 * i, CUP, moved(0.06 * i) if i < 2 else None, scene_view(moved(0.06 * i))) for i in range(5)]
    slipped = [frame(0.1 * i, CUP, moved(0.06 * i + 0.03), scene_view(moved(0.06 * i))) for i in range(5, 8)]
    windows = _run(Keyframer(PARAMS), frames + slipped)
    assert [s.by_odometry for s in windows] == [True, False, False, True, True]
    assert {s.session for s in windows} == {0}
    assert all(item.T_odom_camera is None for s in windows if not s.by_odometry for item in s.frames)
    assert np.allclose(windows[3].T_session_first, moved(0.33))


def test_a_frame_that_neither_odometry_nor_the_views_can_place_is_passed_over_for_a_moment() -> None:
    late = [frame(0.0, CUP, np.eye(4)), blind(0.1), frame(0.2, CUP, moved(0.05))]
    assert [s.session for s in _run(Keyframer(PARAMS), late)] == [0]
    gone = [frame(0.0, CUP, np.eye(4)), blind(0.1), blind(1.2), frame(1.3, CUP, moved(0.05))]
    assert [s.session for s in _run(Keyframer(PARAMS), gone)] == [0, 1, 2]


def test_the_session_goes_on_after_what_was_collected_is_asked_for() -> None:
    keyframer = Keyframer(PARAMS)
    windows = _run(keyframer, [frame(0.0, CUP, np.eye(4))]) + _run(keyframer, [frame(0.5, CUP, moved(2.0))])
    assert [s.session for s in windows] == [0, 0] and windows[1].travelled == pytest.approx(2.0)
    tracked = Keyframer(PARAMS)
    assert [s.session for s in _run(tracked, [frame(0.0, CUP)]) + _run(tracked, [frame(0.1, CUP)])] == [0, 1]


def test_the_way_counts_where_nothing_is_seen_too() -> None:
    there, back = [0.5 * i for i in range(9)], [4.0 - 0.5 * i for i in range(1, 9)]
    book = box("book", (0.5, 0, 1))
    frames = [frame(0.1 * i, (), moved(x)) for i, x in enumerate((there + back)[1:-1], start=1)]
    windows = _run(Keyframer(PARAMS), [frame(0.0, CUP, np.eye(4)), *frames, frame(1.8, (*CUP, book), np.eye(4))])
    assert [round(s.travelled, 3) for s in windows] == [0.0, 8.0]


def test_odometry_carries_what_earlier_views_gave_of_gravity_and_our_own_tracking_does_not() -> None:
    tilt = rotation_from_vector(np.radians([0.0, 0.0, 4.0]))
    known = [frame(0.1 * i, CUP, moved(0.03 * i)) for i in range(29)]
    tracked = [frame(0.1 * i, CUP, None, scene_view(moved(0.03 * i))) for i in range(5)]
    for frames, carried in ((known, True), (tracked, False)):
        warped = replace(frames[-1], gravity=tilt @ frames[-1].gravity)
        last = _run(Keyframer(PARAMS), [*frames[:-1], warped])[-1].frames[0]
        error = np.degrees(np.arccos(last.gravity @ frames[0].gravity))
        assert error < 1.0 if carried else error == pytest.approx(4.0)
        assert last.gravity_confidence > 0.2 if carried else last.gravity_confidence < 0.1


def test_gravity_turns_with_the_camera() -> None:
    turns = [pose(rotation_from_vector(np.radians([5.0 * i, 0.0, 0.0])), np.zeros(3)) for i in range(8)]
    frames = [replace(frame(0.1 * i, CUP, T), gravity=T[:3, :3].T @ [0.0, 1.0, 0.0]) for i, T in enumerate(turns)]
    for window in _run(Keyframer(PARAMS), frames):
        for item, T_first_frame in zip(window.frames, window.T_first_frame, strict=True):
            T = window.T_session_first @ T_first_frame
            assert item.gravity is not None
            np.testing.assert_allclose(item.gravity, inverse(T)[:3, :3] @ [0.0, 1.0, 0.0], atol=1e-9)


def test_a_window_states_how_much_memory_its_frames_hold() -> None:
    seen = frame(0.0, CUP)
    assert seen.view.grey is not None
    (cup,) = CUP
    of_cup = cup.xyz.nbytes + cup.normals.nbytes + cup.flags.nbytes + (0 if cup.rgb is None else cup.rgb.nbytes)
    one = seen.view.xyz.nbytes + seen.view.grey.nbytes + of_cup
    assert FrameWindow.of(seen).nbytes == one
    assert FrameWindow.of(replace(seen, support=cup)).nbytes == one + of_cup
