# SPDX-License-Identifier: Apache-2.0
"""Two places that fit alike: which of them it is, or that nothing says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from registration.samples import box, candidate, keyframe, moved

from objreg_ros.data.closures import Relocalised
from objreg_ros.memory.landmarks import Landmark
from objreg_ros.registrar.closure import Decision
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.rivalry import LEAST_LEAD, Rivalry, apart, may_rival, place_of, rivals
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


def painted(there: Keyframe, shade: int) -> Keyframe:
    assert there.view.grey is not None
    grey = there.view.grey.copy()
    grey[20:36, 30:50] = shade
    return replace(there, view=replace(there.view, grey=grey))


def test_poses_farther_apart_than_odometry_errs_are_of_two_places() -> None:
    assert rivals(ONE, OTHER, PARAMS) and may_rival(ONE, THERE, PARAMS)
    back = Decision(target=THERE, candidate=candidate(moved(-AWAY_M)))  # the same place from there
    assert not rivals(ONE, back, PARAMS)
    drifted = replace(THERE, travelled=70.0)
    assert not apart(HERE, np.eye(4), drifted, np.eye(4), PARAMS)


def test_of_two_sessions_nothing_is_known() -> None:
    assert not apart(HERE, np.eye(4), replace(THERE, session=5), np.eye(4), PARAMS)
    assert not apart(HERE, np.eye(4), replace(THERE, by_odometry=False), np.eye(4), PARAMS)


def test_nothing_decides_between_equal_places_however_often_they_are_seen() -> None:
    rivalry = Rivalry(PARAMS)
    assert [rivalry.winner(new(90 + k), ONE, OTHER, None)[0] for k in range(9)] == [None] * 9


def test_what_differs_decides_once_enough_keyframes_show_it_and_holds_for_the_session() -> None:
    rivalry, bright = Rivalry(PARAMS), painted(HERE, 230)
    one, other = replace(ONE, target=bright), replace(OTHER, target=painted(THERE, 20))
    for k in range(LEAST_LEAD):
        winner, said = rivalry.winner(painted(new(90 + k), 230), one, other, None)
        assert winner is (one if k + 1 >= LEAST_LEAD else None), said
    assert rivalry.winner(new(99), OTHER, ONE, None)[0] is ONE  # nothing that differs is in sight
    assert rivalry.winner(replace(new(100), session=2), ONE, OTHER, None)[0] is None


def test_a_place_that_had_a_rival_is_doubted_until_more_speaks_for_it() -> None:
    rivalry = Rivalry(PARAMS)
    assert rivalry.doubt(new(), ONE) == ""
    bright = painted(HERE, 230)
    one, other = replace(ONE, target=bright), replace(OTHER, target=painted(THERE, 20))
    rivalry.winner(new(), ONE, OTHER, None)
    assert rivalry.doubt(new(91), ONE).startswith("0 keyframes speak for this place, 0 for one")
    for k in range(LEAST_LEAD):
        rivalry.winner(painted(new(92 + k), 230), one, other, None)
    assert rivalry.doubt(new(99), ONE) == "" and rivalry.doubt(new(99), OTHER) != ""
    assert rivalry.doubt(replace(new(99), session=2), OTHER) == ""


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
    assert Rivalry(PARAMS).winner(new(), ONE, OTHER, tied)[0] is OTHER
    assert Rivalry(PARAMS).winner(new(), ONE, OTHER, replace(tied, session=4))[0] is None


def test_the_nearest_object_that_one_place_has_alone_is_where_to_look() -> None:
    def landmark(number: int, label: str, x: float, z: float) -> Landmark:
        xyz = np.array([x, 0.0, z])
        return Landmark(landmark=number, label=label, position=xyz, session=0, stamp_ns=0, sightings=3)

    known = [landmark(1, "cup", 0.0, 1.0), landmark(2, "cup", AWAY_M, 1.0)]
    assert Rivalry(PARAMS, lambda: known).alike(new(), ONE, OTHER).look is None
    known += [landmark(3, "book", AWAY_M + 2.0, 2.0), landmark(4, "chair", -1.0, 1.0)]
    alike = Rivalry(PARAMS, lambda: known).alike(new(), ONE, OTHER)
    assert alike.label == "chair" and alike.look is not None and np.allclose(alike.look, [-1.0, 0.0, 1.0])
    assert alike.advice == "look 45 degrees left, 1.4 m: one has a chair there"
    assert "look around" in replace(alike, look=None).advice
