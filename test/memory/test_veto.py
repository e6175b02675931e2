# SPDX-License-Identifier: Apache-2.0
"""A veto as a row of the store, and back."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose
from objreg_ros.memory.veto import Stand, Veto, numbers_of, stand_of, veto_from_row, veto_row

CLOSURE = LoopClosure(from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",), from_session=3)
STAND = Stand(pose(np.eye(3), np.array([1.0, 2.0, 3.0])), 4.5)


@pytest.mark.parametrize("was_stored", [True, False])
def test_a_veto_comes_back_as_it_was(was_stored: bool) -> None:
    row = veto_row(7, Veto(closure=CLOSURE, stands=(STAND, None), was_stored=was_stored))
    back = veto_from_row(row)
    assert (row["id"], row["from_session"], row["to_session"]) == (7, 3, None)
    assert back.was_stored is was_stored and back.closure.moments == CLOSURE.moments and back.stands[1] is None
    assert back.stands[0] is not None and numbers_of(back.stands[0]).tolist() == numbers_of(STAND).tolist()


def test_a_veto_that_was_changed_is_damaged() -> None:
    row = veto_row(7, Veto(closure=CLOSURE))
    with pytest.raises(ValueError, match="veto 7: expected the checksum"):
        veto_from_row(row | {"was_stored": 0})


def test_a_stand_is_a_pose_and_a_path() -> None:
    with pytest.raises(ValueError, match="17 finite numbers"):
        stand_of(np.zeros(16))
    with pytest.raises(ValueError, match="rigid"):
        stand_of(np.zeros(17))
