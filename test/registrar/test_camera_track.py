# SPDX-License-Identifier: Apache-2.0
"""Tracks of cameras: which runs of the clock go on beside each other, and what they hide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from registration.samples import SECOND, frame, keyframe

from objreg_ros.data.closures import LoopClosure, Reason
from objreg_ros.data.localisation import State
from objreg_ros.keyframes.frame_window import Clock, SessionNumbers
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.memory.veto import Veto
from objreg_ros.registrar.camera_track import MOST_CAMERAS, CameraTrack, CameraTracks, clock_refusals
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.recollection import Recollection
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration.keyframe import Keyframe

PARAMS = RegistrarParams()
FRONT, REAR, OTHER = ("robot1", "front"), ("robot1", "rear"), ("robot2", "front")


def _tracks() -> CameraTracks:
    return CameraTracks(PARAMS, SessionNumbers())


def _seen(store: Store, tracks: CameraTracks, camera: tuple[str, str], session: int, seconds: float) -> Keyframe:
    """A keyframe that is stored and followed."""
    robot, frame_id = camera
    made = keyframe(store.next_keyframe(), seconds, session=session)
    made = replace(made, robot=robot, frame_id=frame_id)
    store.write_keyframe(made, sightings_of(made))
    tracks.of(camera).see(made)
    return made


def test_each_camera_of_each_robot_has_a_track_of_its_own_and_of_too_many_the_oldest_goes() -> None:
    tracks = _tracks()
    first = tracks.of(FRONT)
    assert tracks.of(FRONT) is first and tracks.of(REAR) is not first and tracks.of(OTHER) is not first
    for k in range(MOST_CAMERAS):
        tracks.of(("robot", str(k)))
    assert len(tracks) == MOST_CAMERAS and FRONT not in tracks


def test_the_camera_that_is_followed_here_stays_however_many_others_there_are() -> None:
    tracks = _tracks()
    here = tracks.track_of(frame(0, ()))
    for k in range(2 * MOST_CAMERAS):
        tracks.of(("robot", str(k)))
    assert tracks.track_of(frame(1, ())) is here and len(tracks) == MOST_CAMERAS


def test_sessions_of_another_robot_at_the_same_time_are_not_hidden_and_own_earlier_ones_are() -> None:
    store, tracks = Store(), _tracks()
    _seen(store, tracks, FRONT, 0, 50.0)
    _seen(store, tracks, OTHER, 1, 50.0)
    assert tracks.hidden_from(Clock(20 * SECOND, 2), FRONT, store) == {0}
    assert tracks.hidden_from(Clock(60 * SECOND, 2), FRONT, store) == frozenset()
    assert tracks.hidden_from(Clock(20 * SECOND, 2), ("robot3", "front"), store) == frozenset()


def test_what_a_robots_other_camera_sees_in_the_same_run_is_not_hidden() -> None:
    store, tracks = Store(), _tracks()
    tracks.of(FRONT).begin_run(Clock(10 * SECOND, 0), frozenset(), PARAMS)
    _seen(store, tracks, FRONT, 0, 10.0)
    assert tracks.hidden_from(Clock(10 * SECOND + 5, 1), REAR, store) == frozenset()


def test_where_a_looped_bag_begins_anew_what_both_cameras_saw_before_is_hidden_from_both() -> None:
    store, tracks = Store(), _tracks()
    for session, camera in enumerate((FRONT, REAR)):
        tracks.of(camera).begin_run(Clock(10 * SECOND, session), frozenset(), PARAMS)
        _seen(store, tracks, camera, session, 10.0)
        _seen(store, tracks, camera, session, 40.0)
    again = Clock(10 * SECOND, 2)
    assert tracks.hidden_from(again, FRONT, store) == {0, 1}
    tracks.of(FRONT).begin_run(again, frozenset({0, 1}), PARAMS)
    _seen(store, tracks, FRONT, 2, 10.1)
    assert tracks.hidden_from(Clock(10 * SECOND, 3), REAR, store) == {0, 1}


def test_a_clock_that_hides_sessions_says_so_and_one_that_hides_none_says_nothing() -> None:
    shown = keyframe(1, 20.0)
    (refusal,) = clock_refusals(Clock(20 * SECOND, 3), frozenset({0, 2}), shown)
    assert refusal.reason is Reason.CLOCK and refusal.to_ns == 20 * SECOND
    assert refusal.detail == "the clock began anew at 20.000 s; sessions up to 2 had seen that time before"
    assert clock_refusals(Clock(20 * SECOND, 3), frozenset(), shown) == ()


def _goes_on(
    recollection: Recollection, tracks: CameraTracks, camera: tuple[str, str], clock: Clock, seconds: float
) -> None:
    """A keyframe of the first session of a run of the clock is followed, and stored."""
    store = recollection.store
    robot, frame_id = camera
    made = replace(
        keyframe(store.next_keyframe(), seconds, session=clock.session),
        robot=robot,
        frame_id=frame_id,
    )
    tracks.go_on(made, clock, recollection)
    store.write_keyframe(made, sightings_of(made))


def test_cameras_whose_keyframes_came_one_after_the_other_hide_nothing_once_they_go_on_together() -> None:
    recollection, tracks = Recollection(PARAMS, Store()), _tracks()
    front, rear = Clock(0, 0), Clock(0, 1)
    for seconds in (0.0, 10.0, 20.0):  # what a link kept of the front camera, and of the rear one then
        _goes_on(recollection, tracks, FRONT, front, seconds)
    for seconds in (0.1, 10.1):
        _goes_on(recollection, tracks, REAR, rear, seconds)
    assert tracks.of(REAR).hidden == {0}
    for camera, clock, seconds in ((REAR, rear, 20.1), (FRONT, front, 20.9), (REAR, rear, 21.1)):
        _goes_on(recollection, tracks, camera, clock, seconds)
    assert tracks.of(REAR).hidden == tracks.of(FRONT).hidden == frozenset()


def test_what_the_other_camera_saw_before_the_clock_began_anew_stays_hidden_though_the_last_of_it_came_late() -> None:
    recollection, tracks = Recollection(PARAMS, Store()), _tracks()
    before, rear = Clock(0, 0), Clock(0, 1)
    for seconds in (0.0, 20.0):
        _goes_on(recollection, tracks, FRONT, before, seconds)
    _goes_on(recollection, tracks, REAR, rear, 0.1)
    _goes_on(recollection, tracks, FRONT, before, 20.5)
    for seconds in (0.3, 20.4, 20.6):
        _goes_on(recollection, tracks, REAR, rear, seconds)
    assert tracks.of(REAR).hidden == {0}


def test_a_veto_takes_the_tie_to_a_session_back_and_its_undo_brings_it_again() -> None:
    track = CameraTrack(PARAMS, SessionNumbers())
    earlier, now = (replace(keyframe(n, 10.0 * n, session=n), by_odometry=True) for n in (1, 2))
    track.relocalisation.note_frame(frame(20.0, T_odom_camera=np.eye(4)), now.session)
    track.localisation.expect(now, ())
    closure = LoopClosure(
        from_ns=earlier.stamp_ns,
        to_ns=now.stamp_ns,
        T_from_to=np.eye(4),
        covariance=1e-4 * np.eye(6),
        labels=(),
        evidence={"odds": 5000.0},
        from_session=earlier.session,
        to_session=now.session,
    )
    track.add_closure(closure, now, earlier)
    assert track.localisation.state(now.stamp_ns).state is State.SURE
    track.withdraw((closure,), Vetoes([Veto(closure=closure)]))
    state = track.localisation.state(now.stamp_ns)
    assert state.state is State.TRACKING and state.closure is None and track.relocalisation.relocalised is None
    track.admit(closure, (now, earlier))
    assert track.localisation.state(now.stamp_ns).state is State.SURE
