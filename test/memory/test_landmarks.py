# SPDX-License-Identifier: Apache-2.0
"""Landmarks: ids that stay, and which views of an object are kept."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from registration.samples import box, keyframe, moved

from objreg_ros.data.frames import ObjectCloud
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.memory import landmarks as landmarks_module
from objreg_ros.memory.landmarks import Landmarks, Link, Merge
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.registrar.params import RegistrarParams

PARAMS = RegistrarParams(max_views=3)
CUP, BOOK = box("cup", (0, 0, 1)), box("book", (0.5, 0, 1))


def _seen(number: int, *objects: ObjectCloud, session: int = 0, x: float = 0.0) -> tuple[Sighting, ...]:
    return sightings_of(keyframe(number, number, objects, session, moved(x)))


def _take(landmarks: Landmarks, sightings: tuple[Sighting, ...], links: list[Link] | None = None) -> list[int]:
    named, merged = landmarks.assign(sightings, links or [])
    landmarks.add_sightings(named, merged)
    return [sighting.landmark for sighting in named]


def test_an_object_at_the_same_place_of_a_session_keeps_its_id() -> None:
    landmarks = Landmarks(PARAMS)
    assert _take(landmarks, _seen(1, CUP, BOOK)) == [1, 2]
    assert _take(landmarks, _seen(2, BOOK, box("mouse", (-0.3, 0, 1)), x=0.3)) == [3, 1]


def test_an_object_with_a_stray_point_far_away_keeps_its_id_and_costs_no_more() -> None:
    landmarks = Landmarks(PARAMS)
    vast = tuple(replace(sighting, extent=100.0) for sighting in (*_seen(1, CUP), *_seen(2, CUP)))
    assert _take(landmarks, vast[:1]) == [1]
    tracemalloc.start()
    assert _take(landmarks, vast[1:]) == [1]
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1e6


@pytest.mark.parametrize(
    ("extent", "way", "apart", "same"),
    [
        (0.1, 0.0, 0.115, True),
        (1.0, 0.0, 0.125, False),  # of the smaller extent
        (0.1, 0.5, 0.165, True),
        (0.1, -0.5, 0.165, True),
        (0.1, 10.0, 0.21, True),
        (0.1, 10.0, 0.23, False),  # drift counts up to the radius
    ],
)
def test_an_object_may_be_aside_by_the_radius_a_share_of_its_extent_and_the_drift(
    monkeypatch: pytest.MonkeyPatch, extent: float, way: float, apart: float, same: bool
) -> None:
    monkeypatch.setattr(landmarks_module, "RADIUS_M", 0.1)
    landmarks = Landmarks(PARAMS.replaced(odometry_drift=0.1))
    first = replace(_seen(1, CUP)[0], position=np.array([0.45, 0.0, 0.0]), extent=0.1, travelled=20.0)
    aside = first.position + np.array([apart, 0.0, 0.0])
    _take(landmarks, (first,))
    later = replace(first, keyframe_id=2, position=aside, extent=extent, travelled=20.0 + way)
    assert _take(landmarks, (later,)) == [1 if same else 2]


def test_what_a_closure_claims_for_another_object_is_not_taken_for_its_place() -> None:
    landmarks = Landmarks(PARAMS)
    named, _ = landmarks.assign(_seen(1, CUP))
    landmarks.add_sightings(named)
    claimed = Link(index=1, of=named[0], R_there_here=np.eye(3))
    assert _take(landmarks, _seen(2, CUP, box("cup", (0.8, 0, 1))), [claimed]) == [2, 1]


def test_what_became_of_another_leaves_its_votes_and_no_trace_where_it_was() -> None:
    landmarks = Landmarks(PARAMS)
    mouse, elsewhere = box("mouse", (3, 0, 1)), box("mouse", (5, 0, 1))
    landmarks.add_sightings(seen.of_landmark(1, np.eye(3)) for seen in _seen(1, CUP))
    landmarks.add_sightings(seen.of_landmark(2, np.eye(3)) for seen in (*_seen(2, mouse), *_seen(3, elsewhere)))
    landmarks.add_sightings((), {2: Merge(into=1, R_into_old=np.eye(3))})
    assert [(known.landmark, known.label) for known in landmarks.known()] == [(1, "mouse")]
    assert _take(landmarks, _seen(4, mouse)) == [3]


def test_what_became_of_one_that_is_not_known_has_the_axes_of_that_one() -> None:
    landmarks, R = Landmarks(PARAMS), rotation_from_vector(np.array([0.0, 0.0, 0.5]))
    landmarks.add_sightings(seen.of_landmark(2, np.eye(3)) for seen in _seen(1, CUP))
    landmarks.add_sightings((), {2: Merge(into=1, R_into_old=R)})
    (again,), _ = landmarks.assign(_seen(2, CUP))
    assert again.landmark == 1 and np.allclose(again.R_landmark_session, R)


def test_two_objects_of_one_keyframe_are_never_one_landmark() -> None:
    landmarks = Landmarks(PARAMS)
    _take(landmarks, _seen(1, CUP))
    assert _take(landmarks, _seen(2, CUP, box("cup", (0.02, 0, 1)))) == [1, 2]


def test_an_object_beside_one_that_a_closure_knows_does_not_get_an_id_that_this_merges_away() -> None:
    landmarks = Landmarks(PARAMS)
    first = _seen(1, CUP)
    _take(landmarks, first)
    _take(landmarks, _seen(2, CUP, session=1))
    stored, _ = landmarks.assign(first)
    link = Link(index=0, of=stored[0], R_there_here=np.eye(3))
    assert _take(landmarks, _seen(3, CUP, box("cup", (0.08, 0, 1)), session=1), [link]) == [1, 3]
    assert [known.landmark for known in landmarks.known()] == [1, 3]


def test_of_two_objects_that_closures_put_upon_one_the_first_has_it() -> None:
    landmarks = Landmarks(PARAMS)
    first = _seen(1, CUP)
    _take(landmarks, first)
    stored, _ = landmarks.assign(first)
    links = [Link(index=index, of=stored[0], R_there_here=np.eye(3)) for index in (0, 1)]
    assert _take(landmarks, _seen(2, CUP, box("cup", (2, 0, 1)), session=1), links) == [1, 2]


def _linked(*sightings: Sighting) -> list[Link]:
    """A closure that puts each object of the next keyframe upon one of these, in their order."""
    return [Link(index=index, of=sighting, R_there_here=np.eye(3)) for index, sighting in enumerate(sightings)]


@pytest.mark.parametrize(("label", "side", "apart", "drift"), [("cup", 0.1, 0.15, 0.13), ("chair", 0.6, 0.7, 0.5)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_closure_over_a_drift_onto_the_neighbour_leaves_both_objects_their_ids(
    label: str, side: float, apart: float, drift: float, way: float
) -> None:
    landmarks = Landmarks(PARAMS)

    def pair(shift: float) -> tuple[ObjectCloud, ...]:
        return box(label, (shift, 0, 1), side), box(label, (shift + apart, 0, 1), side)

    first, _ = landmarks.assign(_seen(1, *pair(0.0)))
    landmarks.add_sightings(first)
    assert _take(landmarks, _seen(2, *pair(way * drift)), _linked(*first)) == [1, 2]
    assert _take(landmarks, _seen(3, *pair(way * drift))) == [1, 2]
    assert [known.sightings for known in landmarks.known()] == [3, 3]


def test_a_drifted_object_is_not_joined_with_a_neighbour_that_a_keyframe_shows_beside_it() -> None:
    landmarks = Landmarks(PARAMS)
    first, _ = landmarks.assign(_seen(1, CUP, box("cup", (0.15, 0, 1))))
    landmarks.add_sightings(first)
    assert _take(landmarks, _seen(2, box("cup", (0.14, 0, 1))), _linked(first[0])) == [1]
    assert [known.landmark for known in landmarks.known()] == [1, 2]


def test_closures_that_put_one_object_upon_two_that_a_keyframe_shows_join_nothing() -> None:
    landmarks = Landmarks(PARAMS)
    first, _ = landmarks.assign(_seen(1, CUP, box("cup", (0.5, 0, 1))))
    landmarks.add_sightings(first)
    links = [Link(index=0, of=sighting, R_there_here=np.eye(3)) for sighting in reversed(first)]
    assert _take(landmarks, _seen(2, CUP, session=1), links) == [2]
    assert len(landmarks) == 2


def test_landmarks_that_turn_out_to_be_one_are_seen_in_the_axes_of_the_older() -> None:
    turn = rotation_from_vector(np.array([0.0, 1.2, 0.0]))
    landmarks = Landmarks(PARAMS)
    first, _ = landmarks.assign(_seen(1, CUP))
    landmarks.add_sightings(first)
    T_session_camera = pose(turn.T, np.zeros(3))  # this session began with its axes turned

    def again(number: int) -> tuple[Sighting, ...]:
        return sightings_of(keyframe(number, number, (CUP,), 1, T_session_camera))

    second, _ = landmarks.assign(again(2))
    landmarks.add_sightings(second)
    named, merged = landmarks.assign(again(3), [Link(index=0, of=first[0], R_there_here=turn)])
    landmarks.add_sightings(named, merged)
    assert merged.keys() == {2} and np.allclose(merged[2].R_into_old, turn)
    views = np.array(list(landmarks._known[1].views.values()))
    assert len(views) == 3 and np.allclose(views, views[0])  # the camera stood at one place all the time


def test_another_session_sees_new_objects_until_a_closure_says_otherwise() -> None:
    landmarks = Landmarks(PARAMS)
    first = _seen(1, CUP)
    _take(landmarks, first)
    assert _take(landmarks, _seen(2, CUP, session=1)) == [2]
    stored, _ = landmarks.assign(first)
    link = Link(index=0, of=stored[0], R_there_here=np.eye(3))
    assert _take(landmarks, _seen(3, CUP, session=1), [link]) == [1]
    assert [(known.landmark, known.sightings) for known in landmarks.known()] == [(1, 3)]


def test_known_landmarks_come_with_the_label_most_voted_for() -> None:
    landmarks = Landmarks(PARAMS)
    for number, label in enumerate(("mouse", "cup", "cup"), start=1):
        _take(landmarks, _seen(number, box(label, (0, 0, 1))))
    (known,) = landmarks.known()
    assert (known.label, known.sightings) == ("cup", 3) and np.allclose(known.position, (0, 0, 1), atol=0.01)


def test_of_many_views_of_an_object_the_most_diverse_stay() -> None:
    landmarks = Landmarks(PARAMS)
    for number, x in enumerate((0.0, 0.01, 0.02, 1.0, -1.0), start=1):
        _take(landmarks, _seen(number, box("cup", (-x, 0, 1)), x=x))
    spare = landmarks.surplus([1])
    assert len(spare) == 2 and set(spare) <= {1, 2, 3}
    landmarks.forget_keyframes(spare)
    assert landmarks.surplus([1]) == [] and landmarks.known()[0].sightings == 3


def test_a_keyframe_stays_while_one_of_its_objects_needs_it() -> None:
    landmarks = Landmarks(PARAMS)
    _take(landmarks, _seen(1, CUP, BOOK))
    for number in range(2, 7):
        _take(landmarks, _seen(number, CUP))
    assert 1 not in landmarks.surplus([1, 2])


def test_landmarks_are_the_same_after_a_restart() -> None:
    landmarks = Landmarks(PARAMS)
    named, _ = landmarks.assign(_seen(1, CUP, BOOK))
    again = Landmarks(PARAMS, named)
    assert _take(again, _seen(2, BOOK)) == [2] and _take(again, _seen(3, box("chair", (2, 0, 2)))) == [3]


@pytest.mark.parametrize("x", np.arange(-1.0, 1.0, 0.13))
def test_an_object_keeps_its_id_wherever_the_place_is(x: float) -> None:
    landmarks = Landmarks(PARAMS)
    _take(landmarks, _seen(1, box("chair", (x, 0, 2), 1.0)))
    _take(landmarks, _seen(2, box("chair", (x + 3.0, 0, 2), 1.0)))
    assert _take(landmarks, _seen(3, box("chair", (x + 0.25, 0.1, 2), 1.0))) == [1]


def test_the_landmarks_of_late_are_those_of_the_session_that_were_seen_last() -> None:
    landmarks = Landmarks(PARAMS)
    for number in range(1, 6):
        _take(landmarks, _seen(number, box("cup", (number, 0, 1)), session=number // 5))
    _take(landmarks, _seen(6, box("cup", (5, 0, 1)), session=1))
    assert [known.landmark for known in landmarks.recent(0, 3)] == [3, 4]
    assert [known.landmark for known in landmarks.recent(1, 3)] == [5]


def test_the_places_of_landmarks_are_those_in_the_sessions_asked_for_of_the_ones_seen_last() -> None:
    landmarks = Landmarks(PARAMS)
    for number in range(1, 6):
        _take(landmarks, _seen(number, box("cup", (number, 0, 1)), session=number // 5))
    _take(landmarks, _seen(6, box("cup", (5, 0, 1)), session=1))
    placed = landmarks.placed({0, 1}, 3)
    assert [(number, last.session, views) for number, last, views in placed] == [(5, 1, 2), (4, 0, 1), (3, 0, 1)]
    assert np.allclose(placed[1][1].position, (4, 0, 1), atol=0.01)
    assert [number for number, *_ in landmarks.placed({0}, 2)] == [4]
    assert landmarks.placed({7}, 3) == [] and landmarks.placed((), 3) == []


def test_a_landmark_whose_last_keyframe_is_forgotten_is_gone_and_its_id_is_not_given_again() -> None:
    landmarks = Landmarks(PARAMS)
    for keyframe_id in (1, 2):
        assert _take(landmarks, _seen(keyframe_id, CUP)) == [1]
    landmarks.forget_keyframes([1])
    assert [known.landmark for known in landmarks.known()] == [1]
    landmarks.forget_keyframes([2])
    assert not landmarks.known() and not landmarks._there
    assert _take(landmarks, _seen(3, CUP)) == [2]


def test_a_late_closure_joins_the_landmarks_that_it_says_are_one() -> None:
    turn = rotation_from_vector(np.array([0.0, 1.2, 0.0]))
    landmarks = Landmarks(PARAMS)
    first, _ = landmarks.assign(_seen(1, CUP))
    landmarks.add_sightings(first)
    second, _ = landmarks.assign(sightings_of(keyframe(2, 2, (CUP,), 1, pose(turn.T, np.zeros(3)))))
    landmarks.add_sightings(second)
    merged = landmarks.joined([(second[0], first[0])], turn)
    assert merged.keys() == {2} and merged[2].into == 1 and np.allclose(merged[2].R_into_old, turn)
    back = landmarks.joined([(first[0], second[0])], turn.T)
    assert back.keys() == {2} and np.allclose(back[2].R_into_old, turn)
    landmarks.add_sightings((), merged)
    views = np.array(list(landmarks._known[1].views.values()))
    assert len(landmarks) == 1 and len(views) == 2 and np.allclose(views, views[0])


def test_what_a_late_closure_joins_is_where_it_was_seen_last_as_after_a_restart() -> None:
    landmarks, turn = Landmarks(PARAMS), rotation_from_vector(np.array([0.0, 0.0, 0.5]))
    first, _ = landmarks.assign(_seen(1, CUP))
    landmarks.add_sightings(first)
    second, _ = landmarks.assign(_seen(2, CUP, session=1, x=5.0))
    landmarks.add_sightings(second)
    landmarks.add_sightings((), landmarks.joined([(second[0], first[0])], turn))
    (known,) = landmarks.known()
    assert (known.landmark, known.session, known.stamp_ns, known.sightings) == (1, 1, second[0].stamp_ns, 2)
    assert np.array_equal(known.position, second[0].position)
    (again,) = Landmarks(PARAMS, [first[0], second[0].of_landmark(1, turn)]).known()
    assert (again.session, again.stamp_ns) == (known.session, known.stamp_ns)
    assert _take(landmarks, _seen(3, CUP, session=1, x=5.0)) == [1]


def test_a_late_closure_joins_no_two_that_a_keyframe_shows_together() -> None:
    landmarks = Landmarks(PARAMS)
    first, _ = landmarks.assign(_seen(1, CUP, BOOK))
    landmarks.add_sightings(first)
    assert landmarks.joined([(first[1], first[0])], np.eye(3)) == {}
    assert landmarks.joined([(first[0], first[0])], np.eye(3)) == {}


def test_a_landmark_names_the_robot_that_saw_it_last() -> None:
    landmarks = Landmarks(PARAMS)
    _take(landmarks, _seen(1, CUP))
    (later,) = _seen(2, CUP, session=1)
    link = Link(index=0, of=_seen(1, CUP)[0].of_landmark(1, np.eye(3)), R_there_here=np.eye(3))
    assert _take(landmarks, (replace(later, robot="robot2"),), [link]) == [1]
    assert [(known.landmark, known.robot, known.session) for known in landmarks.known()] == [(1, "robot2", 1)]
