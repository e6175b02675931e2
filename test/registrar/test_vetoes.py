# SPDX-License-Identifier: Apache-2.0
"""Which poses say again what a person has withdrawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose
from objreg_ros.memory.veto import Stand, Veto
from objreg_ros.registrar.consistency import Standpoint
from objreg_ros.registrar.vetoes import Vetoes

SECOND = 1_000_000_000


def at(metres: float) -> np.ndarray:
    return pose(np.eye(3), np.array([metres, 0.0, 0.0]))


CLOSURE = LoopClosure(
    from_ns=0,
    to_ns=60 * SECOND,
    T_from_to=at(0.2),
    covariance=np.eye(6),
    labels=("cup",),
    from_session=0,
    to_session=1,
)
VETO = Veto(closure=CLOSURE, stands=(Stand(at(1.0), 1.0), Stand(at(5.0), 5.0)))


def standpoint(seconds: int, session: int, metres: float) -> Standpoint:
    return Standpoint(seconds * SECOND, session, at(metres), metres)


def test_the_pair_itself_is_covered_whatever_its_pose() -> None:
    source, target = standpoint(60, 1, 5.0), standpoint(0, 0, 1.0)
    assert Vetoes([VETO]).covers(source, target, at(9.0))
    assert Vetoes([replace(VETO, stands=(None, None))]).covers(source, target, at(9.0))
    assert not Vetoes().covers(source, target, at(0.2))


def test_neighbours_are_covered_where_odometry_carries_the_withdrawn_pose_to_them() -> None:
    vetoes, target = Vetoes([VETO]), standpoint(1, 0, 1.3)
    source = standpoint(61, 1, 5.4)  # 0.3 m on there and 0.4 m on here: 0.1 m more between them
    assert vetoes.covers(source, target, at(0.3))
    assert vetoes.covers(target, source, inverse(at(0.3)))
    assert not vetoes.covers(source, target, at(0.6))


def test_another_revisit_of_the_place_is_not_covered() -> None:
    vetoes = Vetoes([VETO])
    assert not vetoes.covers(standpoint(61, 2, 5.0), standpoint(1, 0, 1.0), at(0.2))
    assert not vetoes.covers(standpoint(300, 1, 25.0), standpoint(1, 0, 1.0), at(0.2))


def test_without_the_place_of_a_keyframe_its_neighbours_are_not_covered() -> None:
    vetoes = Vetoes([replace(VETO, stands=(None, VETO.stands[1]))])
    assert not vetoes.covers(standpoint(61, 1, 5.0), standpoint(1, 0, 1.0), at(0.2))


def test_what_is_taken_back_covers_nothing() -> None:
    vetoes = Vetoes([VETO])
    assert CLOSURE in vetoes and len(vetoes) == 1 and list(vetoes) == [VETO]
    assert vetoes.remove(CLOSURE) is VETO and vetoes.remove(CLOSURE) is None
    assert CLOSURE not in vetoes and not vetoes.covers(standpoint(60, 1, 5.0), standpoint(0, 0, 1.0), at(0.2))


@pytest.mark.parametrize("end", ["from_session", "to_session"])
def test_a_closure_without_a_session_is_known_and_covers_nothing(end: str) -> None:
    without = replace(CLOSURE, **{end: None})
    vetoes = Vetoes([replace(VETO, closure=without)])
    assert without in vetoes and not vetoes.covers(standpoint(60, 1, 5.0), standpoint(0, 0, 1.0), at(0.2))
