# SPDX-License-Identifier: Apache-2.0
"""Two places that fit alike: which of them it is, or that nothing says so."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
from registration.samples import box, candidate, keyframe, moved

from objreg_ros.data.closures import Relocalised
from objreg_ros.registrar.closure import Decision
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.relocalisation import Relocalisation
from objreg_ros.registrar.rivalry import LEAST_LEAD, TIED_BY, Rivalry, apart, may_rival, place_of, rivals
from objreg_ros.registration.keyframe import Keyframe

PARAMS = RegistrarParams()
CUPS = (box("cup", (0.0, 0.0, 1.0)),)
AWAY_M = 6.0


def stored(number: int, x: float, travelled: float) -> Keyframe:
    there = keyframe(number, number, CUPS)
    return replace(there, T_odom_camera=moved(x), by_odometry=True, travelled=travelled, session=0)


def new(seconds: float = 90) -> Keyframe:
    return replace(keyframe(9, seconds, CUPS), T_odom_camera=moved(1.0), by_odometry=True, session=1)


HERE, THERE = stored(1, 0.0, 0.0), stored(2, AWAY_M, 7.0)
ONE, OTHER = (Decision(target=target, candidate=candidate()) for target in (HERE, THERE))


def rivalry(tied: Relocalised | None = None) -> Rivalry:
    """What decides for a camera that is tied so."""
    return Rivalry(cast(Relocalisation, SimpleNamespace(relocalised=tied)))


def painted(there: Keyframe, shade: int) -> Keyframe:
    assert there.view.grey is not None
    grey = there.view.grey.copy()
    grey[20:36, 30:50] = shade
    return replace(there, view=replace(there.view, grey=grey))


def test_poses_farther_apart_than_odometry_errs_are_of_two_places() -> None:
    assert rivals(ONE, OTHER, PARAMS) and may_rival(new(), ONE, THERE, PARAMS)
    back = Decision(target=THERE, candidate=candidate(moved(-AWAY_M)))  # the same place from there
    assert not rivals(ONE, back, PARAMS)
    drifted = replace(THERE, travelled=70.0)
    assert not apart(HERE, np.eye(4), drifted, np.eye(4), PARAMS)


def test_a_keyframe_from_afar_that_shows_the_same_things_is_of_the_same_place() -> None:
    afar = stored(2, -3.0, 7.0)
    assert may_rival(new(), ONE, afar, PARAMS)
    shows = replace(afar, objects=keyframe(2, 2, (box("cup", (3.0, 0.0, 1.0)),)).objects)
    assert not may_rival(new(), ONE, shows, PARAMS)


def test_of_two_sessions_nothing_is_known() -> None:
    assert not apart(HERE, np.eye(4), replace(THERE, session=5), np.eye(4), PARAMS)
    assert not apart(HERE, np.eye(4), replace(THERE, by_odometry=False), np.eye(4), PARAMS)


def test_nothing_decides_between_equal_places_however_often_they_are_seen() -> None:
    judge = rivalry()
    assert [judge.winner(new(90 + k), ONE, OTHER)[0] for k in range(9)] == [None] * 9


def test_what_differs_decides_once_enough_keyframes_show_it_and_holds_for_the_session() -> None:
    judge, bright = rivalry(), painted(HERE, 230)
    one, other = replace(ONE, target=bright), replace(OTHER, target=painted(THERE, 20))
    for k in range(LEAST_LEAD):
        winner, said = judge.winner(painted(new(90 + k), 230), one, other)
        assert winner is (one if k + 1 >= LEAST_LEAD else None), said
    assert judge.winner(new(99), OTHER, ONE)[0] is ONE  # nothing that differs is in sight
    assert judge.winner(replace(new(100), session=2), ONE, OTHER)[0] is None


def test_a_place_that_had_a_rival_is_doubted_until_more_speaks_for_it() -> None:
    judge = rivalry()
    assert judge.doubt(new(), ONE) == ""
    bright = painted(HERE, 230)
    one, other = replace(ONE, target=bright), replace(OTHER, target=painted(THERE, 20))
    judge.winner(new(), ONE, OTHER)
    assert judge.doubt(new(91), ONE).startswith("0 keyframes speak for this place, 0 for one")
    for k in range(LEAST_LEAD):
        judge.winner(painted(new(92 + k), 230), one, other)
    assert judge.doubt(new(99), ONE) == "" and judge.doubt(new(99), OTHER) != ""
    assert judge.doubt(replace(new(99), session=2), OTHER) == ""


def test_the_tie_to_the_map_decides_where_nothing_differs() -> None:
    place = place_of(new(), OTHER)
    tied = Relocalised(
        stamp_ns=1,
        session=0,
        target_ns=1,
        T_map_odom=place.T_map_odom,
        T_map_camera=np.eye(4),
        covariance=np.eye(6),
        closures=3,
    )
    assert rivalry(tied).winner(new(), ONE, OTHER)[0] is OTHER
    assert rivalry(replace(tied, session=4)).winner(new(), ONE, OTHER)[0] is None
    assert rivalry(replace(tied, closures=TIED_BY - 1)).winner(new(), ONE, OTHER)[0] is None
