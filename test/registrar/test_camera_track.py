# SPDX-License-Identifier: Apache-2.0
"""Tracks of cameras: which runs of the clock go on beside each other, and what they hide."""

from __future__ import annotations

from dataclasses import replace

from registration.samples import SECOND, keyframe

from objreg_ros.data import Reason
from objreg_ros.keyframes.frame_window import Clock, SessionNumbers
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.camera_track import MOST_CAMERAS, CameraTracks, clock_refusals
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrarParams

PARAMS = RegistrarParams()
FRONT, REAR, OTHER = ("robot1", "front"), ("robot1", "rear"), ("robot2", "front")


def _tracks() -> CameraTracks:
    return CameraTracks(PARAMS, SessionNumbers())


def _seen(store: Store, tracks: CameraTracks, camera: tuple[str, str], session: int, seconds: float) -> Keyframe:
    """A keyframe that is stored and followed."""
    robot, frame_id = camera
    made = keyframe(store.next_keyframe(), seconds, session=session)
    made = replace(made, robot=robot, frame_id=frame_id)
    store.add(made, sightings_of(made))
    tracks.of(camera).see(made)
    return made


def test_each_camera_of_each_robot_has_a_track_of_its_own_and_of_too_many_the_oldest_goes() -> None:
    tracks = _tracks()
    first = tracks.of(FRONT)
    assert tracks.of(FRONT) is first and tracks.of(REAR) is not first and tracks.of(OTHER) is not first
    for k in range(MOST_CAMERAS):
        tracks.of(("robot", str(k)))
    assert len(tracks) == MOST_CAMERAS and FRONT not in tracks


def test_sessions_of_another_robot_at_the_same_time_are_not_hidden_and_own_earlier_ones_are() -> None:
    store, tracks = Store(), _tracks()
    _seen(store, tracks, FRONT, 0, 50.0)
    _seen(store, tracks, OTHER, 1, 50.0)
    assert tracks.hidden_from(Clock(20 * SECOND, 2), FRONT, store) == {0}
    assert tracks.hidden_from(Clock(60 * SECOND, 2), FRONT, store) == frozenset()
    assert tracks.hidden_from(Clock(20 * SECOND, 2), ("robot3", "front"), store) == frozenset()


def test_what_a_robots_other_camera_sees_in_the_same_run_is_not_hidden() -> None:
    store, tracks = Store(), _tracks()
    tracks.of(FRONT).begin(Clock(10 * SECOND, 0), frozenset(), PARAMS)
    _seen(store, tracks, FRONT, 0, 10.0)
    assert tracks.hidden_from(Clock(10 * SECOND + 5, 1), REAR, store) == frozenset()


def test_where_a_looped_bag_begins_anew_what_both_cameras_saw_before_is_hidden_from_both() -> None:
    store, tracks = Store(), _tracks()
    for session, camera in enumerate((FRONT, REAR)):
        tracks.of(camera).begin(Clock(10 * SECOND, session), frozenset(), PARAMS)
        _seen(store, tracks, camera, session, 10.0)
        _seen(store, tracks, camera, session, 40.0)
    again = Clock(10 * SECOND, 2)
    assert tracks.hidden_from(again, FRONT, store) == {0, 1}
    tracks.of(FRONT).begin(again, frozenset({0, 1}), PARAMS)
    _seen(store, tracks, FRONT, 2, 10.1)
    assert tracks.hidden_from(Clock(10 * SECOND, 3), REAR, store) == {0, 1}


def test_a_clock_that_hides_sessions_says_so_and_one_that_hides_none_says_nothing() -> None:
    shown = keyframe(1, 20.0)
    (told,) = clock_refusals(Clock(20 * SECOND, 3), frozenset({0, 2}), shown)
    assert told.reason is Reason.CLOCK and told.to_ns == 20 * SECOND
    assert told.detail == "the clock began anew at 20.000 s; sessions up to 2 had seen that time before"
    assert clock_refusals(Clock(20 * SECOND, 3), frozenset(), shown) == ()
