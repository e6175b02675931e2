# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from registration.samples import keyframe, moved

from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_tools.merge.one_map import Placed, Track, odometry_of, one_maps, tied, tracks_of, within_sessions
from objreg_tools.truth import Truth, Truths

SECOND = 1_000_000_000


def track(session: int, *xs: float, robot: str = "", shift: float = 0.0) -> Track:
    """A camera that is at ``xs`` along x, ten seconds from one to the next; its odometry begins elsewhere."""
    stamps = [SECOND * (100 * session + 10 * k) for k in range(len(xs))]
    return Track(session, robot, [Placed(stamp, moved(x - shift)) for stamp, x in zip(stamps, xs, strict=True)])


def closing(one: Track, k: int, other: Track, m: int, x: float) -> LoopClosure:
    """A closure of keyframe ``k`` of a track and ``m`` of another, which is so far along x of the first."""
    return LoopClosure(
        from_ns=one.keyframes[k].stamp_ns,
        to_ns=other.keyframes[m].stamp_ns,
        T_from_to=moved(x),
        covariance=np.eye(6) * 1e-5,
        labels=("cup",),
        from_session=one.session,
        to_session=other.session,
        from_robot=one.robot,
        to_robot=other.robot,
    )


def pair() -> tuple[Track, Track, list[LoopClosure]]:
    """Two robots that drive beside each other, the odometry of the second 5 m off, tied at three places."""
    one, other = track(0, 0, 1, 2, 3, robot="a"), track(1, 0, 1, 2, 3, robot="b", shift=5.0)
    return one, other, [closing(one, k, other, k, 0.0) for k in (0, 1, 3)]


def at(maps: Sequence, track: Track, k: int) -> float:
    return float(maps[0].poses[track.session, track.keyframes[k].stamp_ns][0, 3])


def test_sessions_that_are_tied_are_in_the_frame_of_the_first() -> None:
    one, other, closures = pair()
    maps = one_maps([one, other, track(2, 0, 1)], closures)
    assert [found.sessions for found in maps] == [(0, 1), (2,)]
    assert at(maps, other, 2) == pytest.approx(2.0, abs=0.01) and at(maps, one, 3) == pytest.approx(3.0, abs=0.01)
    assert maps[0].kept == 3 and maps[0].contradictions == ()


def test_a_clock_that_was_set_in_a_session_leaves_a_gap_and_costs_nothing() -> None:
    one, other, closures = pair()
    late = [keyframe._replace(stamp_ns=keyframe.stamp_ns + 10**18) for keyframe in one.keyframes[2:]]
    leapt = replace(one, keyframes=[*one.keyframes[:2], *late])
    assert len(list(odometry_of(leapt))) == len(list(odometry_of(one))) - 19
    tie = closing(leapt, 3, other, 3, 0.0)
    (found,) = one_maps([leapt, other], [*closures[:2], tie])
    assert found.kept == 3 and found.contradictions == ()
    assert at([found], leapt, 3) == pytest.approx(3.0, abs=0.05)


def test_a_closure_that_all_others_contradict_is_listed_with_how_far_it_is_off() -> None:
    one, other, closures = pair()
    more = [closing(one, 2, other, 2, 0.0), closing(other, 0, other, 3, 3.0)]
    lie = closing(one, 1, other, 2, 3.0)
    (found,) = one_maps([one, other], [*closures, *more, lie])
    (contradiction,) = found.contradictions
    assert contradiction.closure is lie and contradiction.why.startswith("not believed")
    assert contradiction.translation_cm == pytest.approx(200.0, abs=5.0)


def test_a_closure_that_leads_farther_than_the_camera_went_cannot_be() -> None:
    one, other, closures = pair()
    (found,) = one_maps([one, other], [*closures, closing(one, 0, one, 3, 50.0)])
    assert [contradiction.why[:9] for contradiction in found.contradictions] == ["cannot be"]


def test_the_error_of_a_map_is_that_of_its_keyframes_by_the_truth_of_their_robots() -> None:
    one, other, closures = pair()
    true = {t.robot: Truth([(k.stamp_ns, moved(x)) for x, k in enumerate(t.keyframes)]) for t in (one, other)}
    (found,) = one_maps([one, other], closures)
    error = found.error_cm(Truths(true))
    assert error is not None and error[0] < 1.0 and error[1] == 8
    assert found.error_cm(Truths({"c": true["a"]})) is None


def test_groups_are_those_that_closures_lead_through() -> None:
    tracks = [track(k, 0, 1) for k in range(4)]
    closures = [closing(tracks[3], 0, tracks[1], 0, 0.0), closing(tracks[1], 0, tracks[0], 0, 0.0)]
    assert tied(tracks, closures) == [{0, 1, 3}, {2}]
    assert within_sessions([*closures, replace(closures[0], from_session=None)], {1, 3}) == closures[:1]


def test_the_sessions_of_a_store_are_read_without_their_keyframes() -> None:
    store = Store()
    for number, (seconds, session, x) in enumerate([(1.0, 0, 0.0), (2.0, 1, 0.0), (3.0, 0, 1.0)], start=1):
        one = replace(keyframe(number, seconds, session=session), T_odom_camera=moved(x))
        store.write_keyframe(one, sightings_of(one))
    first, second = tracks_of(store)
    assert (first.session, len(first.keyframes), second.session) == (0, 2, 1)
    assert (inverse(first.keyframes[0].T_session_camera) @ first.keyframes[1].T_session_camera)[0, 3] == 1.0


def test_a_closure_of_a_keyframe_that_is_not_stored_any_more_is_counted_and_ties_nothing() -> None:
    one, other, closures = pair()
    forgotten = replace(closures[0], from_ns=5 * SECOND, T_from_to=moved(9.0))
    (found,) = one_maps([one, other], [*closures, forgotten])
    assert (found.lost, found.kept, found.contradictions) == (1, 3, ())


@pytest.mark.parametrize(("x", "travelled"), [(0.0, 20.0), (3.0, 20.0), (3.0, 3.0), (3.0, 0.0)])
def test_odometry_between_keyframes_is_as_long_as_the_path_was(x: float, travelled: float) -> None:
    track = Track(0, "", [Placed(0, moved(0.0)), Placed(20 * SECOND, moved(x), travelled)])
    stamps, poses = zip(*odometry_of(track), strict=True)
    path = sum(np.linalg.norm(T[:3, 3] - S[:3, 3]) for S, T in pairwise(poses))
    assert path == pytest.approx(max(travelled, x), rel=1e-6)
    assert (poses[0] == moved(0.0)).all() and (poses[-1] == moved(x)).all()
    assert max(b - a for a, b in pairwise(stamps)) <= 0.5 * SECOND
