# SPDX-License-Identifier: Apache-2.0
"""Retrieval: which stored keyframes a new one is compared with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import box, keyframe, moved

from objreg_ros.data.frames import ObjectCloud
from objreg_ros.memory.retrieval import _KERNELS, Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.registrar.params import RegistrarParams

PARAMS = RegistrarParams(min_gap=2.0, candidates=3, thin_seconds=1.0)


def _seen(
    number: int, seconds: float, *objects: ObjectCloud, session: int = 0, x: float = 0.0, by_odometry: bool = True
) -> list[Sighting]:
    shown = keyframe(number, seconds, objects, session, moved(x))
    return list(sightings_of(replace(shown, travelled=seconds, by_odometry=by_odometry)))


def _index(*keyframes: list[Sighting], params: RegistrarParams = PARAMS) -> Index:
    index = Index(params)
    for sightings in keyframes:
        index.add_objects(sightings)
    return index


CUP, BOOK, CHAIR = box("cup", (0, 0, 1)), box("book", (0.3, 0, 1), 0.2), box("chair", (0, 0, 2), 0.6)


def test_a_place_with_the_same_objects_comes_first() -> None:
    index = _index(_seen(1, 0, CHAIR), _seen(2, 10, CUP, BOOK), _seen(3, 20, BOOK))
    found = [candidate.keyframe_id for candidate in index.query(_seen(9, 100, CUP, BOOK))]
    assert found == [2, 3]


def test_an_empty_index_and_a_keyframe_of_unknown_objects_find_nothing() -> None:
    assert _index().query(_seen(9, 100, CUP)) == []
    assert _index(_seen(1, 0, CHAIR)).query(_seen(9, 100, CUP)) == []


def test_confusable_labels_find_each_other() -> None:
    index = _index(_seen(1, 0, CUP))
    assert [candidate.keyframe_id for candidate in index.query(_seen(9, 100, box("mouse", (0, 0, 1))))] == [1]


def test_what_was_seen_a_moment_ago_is_no_loop() -> None:
    index = _index(_seen(1, 0, CUP), _seen(2, 9.5, CUP))
    assert [candidate.keyframe_id for candidate in index.query(_seen(9, 10, CUP))] == [1]


def test_odometry_takes_out_what_cannot_be_there_in_the_same_session_only() -> None:
    params = PARAMS.replaced(odometry_radius=1.0, odometry_drift=0.1)
    index = _index(_seen(1, 0, CUP, x=8.0), _seen(2, 10, CUP, session=1, x=8.0), params=params)
    assert [candidate.keyframe_id for candidate in index.query(_seen(9, 30, CUP))] == [2]
    wide = _index(_seen(1, 0, CUP, x=8.0), params=params.replaced(odometry_drift=1.0))
    assert [candidate.keyframe_id for candidate in wide.query(_seen(9, 30, CUP))] == [1]


@pytest.mark.parametrize("carried", [(False, False), (True, False), (False, True)])
def test_our_own_tracking_takes_out_nothing(carried: tuple[bool, bool]) -> None:
    params = PARAMS.replaced(odometry_radius=1.0, odometry_drift=0.1)
    index = _index(_seen(1, 0, CUP, x=8.0, by_odometry=carried[0]), params=params)
    assert [candidate.keyframe_id for candidate in index.query(_seen(9, 30, CUP, by_odometry=carried[1]))] == [1]


def test_an_object_of_another_size_or_colour_gets_a_lower_vote() -> None:
    index = _index(_seen(1, 0, box("box", (0, 0, 1), 0.4)), _seen(2, 10, box("box", (0, 0, 1), 0.1)))
    ranked = index.query(_seen(9, 100, box("box", (0, 0, 1), 0.1)))
    assert [candidate.keyframe_id for candidate in ranked] == [2, 1] and ranked[0].votes > 2 * ranked[1].votes


def test_an_object_votes_once_for_a_keyframe_by_the_likest_that_it_shows_and_all_votes_add_up() -> None:
    numbers, ballots = np.array([7, 3, 7, 3, 7]), np.array([0, 0, 0, 1, 1])
    alone = np.zeros((5, 3)), np.zeros((2, 3))  # all objects at one point: no pair of them
    first, votes = _KERNELS.tally(numbers, ballots, np.array([0.9, 0.8, 0.5, 0.4, 0.1]), *alone)
    assert first.tolist() == [1, 0] and votes == pytest.approx([1.2, 1.0])


@pytest.mark.parametrize(("gap", "more"), [(0.5, 1.0), (0.58, np.exp(-0.5)), (1.5, 0.0)])
def test_two_objects_as_far_from_each_other_as_those_asked_for_vote_together_too(gap: float, more: float) -> None:
    stored, asked = np.array([[0.0, 0, 0], [0.0, gap, 0]]), np.array([[2.0, 0, 0], [2.5, 0, 0]])
    _, votes = _KERNELS.tally(np.array([7, 7]), np.array([0, 1]), np.ones(2), stored, asked)
    assert votes == pytest.approx([2.0 + more], abs=1e-6)


def test_of_two_places_with_the_same_objects_that_with_their_arrangement_comes_first() -> None:
    apart = box("book", (1.3, 0, 1), 0.2)
    index = _index(_seen(1, 0, CUP, apart), _seen(2, 10, CUP, BOOK, session=1))
    found = index.query(_seen(9, 100, CUP, BOOK, session=2))
    assert [candidate.keyframe_id for candidate in found] == [2, 1] and found[0].votes > 1.3 * found[1].votes


def test_the_place_with_the_most_votes_is_next_and_lowers_those_of_its_pass() -> None:
    worth = np.array([[1, 0.5, 1], [0.5, 1, 1], [1, 1, 1]])
    assert _KERNELS.in_turn(np.array([1.0, 0.9, 0.6]), worth).tolist() == [0, 2, 1]
    assert _KERNELS.in_turn(np.array([1.0, 0.9, 0.3]), worth).tolist() == [0, 1, 2]
    assert _KERNELS.in_turn(np.zeros(3), worth).tolist() == [0, 1, 2]


def test_fifty_other_rooms_with_things_as_alike_do_not_crowd_out_the_place_where_odometry_is() -> None:
    rooms = [_seen(k, float(k), CUP, session=k) for k in range(1, 51)]
    here = [_seen(51 + k, 100.0 + 20 * k, CUP, session=51) for k in range(2)]
    found = _index(*rooms, *here).query(_seen(99, 200, CUP, session=51))
    assert {52, 51} <= {candidate.keyframe_id for candidate in found[: PARAMS.candidates]}


def test_a_session_that_met_the_one_that_goes_on_comes_before_other_rooms_and_so_do_those_that_it_met() -> None:
    rooms = [_seen(k, 10.0 * k, CUP, session=k) for k in range(1, 11)]
    index, asked = _index(*rooms), _seen(99, 300, CUP, session=20)
    assert [candidate.keyframe_id for candidate in index.query(asked)[:3]] == [1, 2, 3]
    index.meet(7, 4)
    index.meet(20, 7)
    found = index.query(asked)
    assert [candidate.keyframe_id for candidate in found[:3]] == [4, 7, 1]
    assert found[0].votes > 2 * found[2].votes and found[0].votes == found[1].votes


def test_stored_sessions_with_a_landmark_in_common_have_met_and_what_has_no_landmark_has_met_nothing() -> None:
    rooms = [_seen(k, 10.0 * k, CUP, session=k) for k in range(1, 4)]
    named = [x.of_landmark(number, np.eye(3)) for (x,), number in zip(rooms, (5, 6, 5), strict=True)]
    index = Index(PARAMS)
    index.add_objects(named)
    assert [candidate.keyframe_id for candidate in index.query(_seen(99, 300, CUP, session=1))] == [1, 3, 2]
    unnamed = _index(*rooms).query(_seen(99, 300, CUP, session=3))
    assert [candidate.keyframe_id for candidate in unnamed] == [3, 1, 2]


def test_neighbours_of_a_chosen_keyframe_give_way_to_other_moments() -> None:
    index = _index(_seen(1, 0.0, CUP), _seen(2, 0.1, CUP), _seen(3, 0.2, CUP), _seen(4, 10, CUP))
    assert [candidate.keyframe_id for candidate in index.query(_seen(9, 100, CUP))] == [1, 4, 2, 3]


def test_passes_by_here_take_turns_and_this_one_comes_last() -> None:
    params = PARAMS.replaced(min_gap=0.5, odometry_radius=99.0)
    index = _index(*(_seen(k, float(k), CUP) for k in (1, 2, 50, 51, 99)), params=params)
    assert [candidate.keyframe_id for candidate in index.query(_seen(100, 100, CUP))] == [1, 50, 99, 2, 51]


def test_a_removed_keyframe_is_not_found_again() -> None:
    index = _index(_seen(1, 0, CUP), _seen(2, 10, CUP, BOOK))
    index.remove([2])
    assert len(index) == 1 and [candidate.keyframe_id for candidate in index.query(_seen(9, 100, CUP, BOOK))] == [1]


def test_many_objects_give_the_same_answer_in_any_growth_of_the_index() -> None:
    draw = np.random.default_rng(0)
    sizes = draw.uniform(0.05, 0.5, 300)
    many = [_seen(i, 10.0 * i, box("box", (0, 0, 1), float(size))) for i, size in enumerate(sizes)]
    index = _index(*many, params=PARAMS.replaced(candidates=1))
    wanted = int(np.argmin(np.abs(sizes - 0.3)))
    assert index.query(_seen(999, 1e5, box("box", (0, 0, 1), float(sizes[wanted]))))[0].keyframe_id == wanted
