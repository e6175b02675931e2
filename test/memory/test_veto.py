# SPDX-License-Identifier: Apache-2.0
"""A veto as a row of the store, and back."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.closure_id import identity_of
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose
from objreg_ros.memory.codec import closure_row
from objreg_ros.memory.migration import insert
from objreg_ros.memory.store_file import temporary
from objreg_ros.memory.veto import (
    Stand,
    Veto,
    closure_numbers,
    closures_at,
    numbers_among,
    numbers_of,
    stand_of,
    veto_from_row,
    veto_row,
)

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


def test_rows_of_closures_and_vetoes_are_found_by_what_names_them() -> None:
    store = temporary()
    others = [replace(CLOSURE, to_ns=2 + k, from_robot="robot1", to_frame_id=f'rear "{k}"') for k in range(3)]
    for number, one in enumerate((CLOSURE, *others), start=5):
        insert(store, "closure", closure_row(number, one))
    insert(store, "veto", veto_row(9, Veto(closure=others[0])))
    numbers = list(closure_numbers(store, "closure"))
    assert numbers == [(identity_of(one), 8 - k) for k, one in enumerate((*others[::-1], CLOSURE))]
    assert list(closure_numbers(store, "veto")) == [(identity_of(others[0]), 9)]
    assert [one.moments for one in closures_at(store, [8, 5])] == [others[2].moments, CLOSURE.moments]
    with pytest.raises(ValueError, match="expected a closure of the number 4, got none"):
        list(closures_at(store, [4]))


def test_a_name_that_a_store_of_before_lacks_is_that_of_a_closure_without_it() -> None:
    store, row = temporary(), closure_row(1, CLOSURE)
    fields = {name: value for name, value in json.loads(row["fields"]).items() if not name.endswith(("robot", "id"))}
    insert(store, "closure", row | {"fields": json.dumps(fields)})
    assert list(closure_numbers(store, "closure")) == [(identity_of(CLOSURE), 1)]


def test_what_is_not_named_may_be_damaged_and_what_is_named_is_found_damaged() -> None:
    store = temporary()
    insert(store, "closure", closure_row(1, CLOSURE))
    insert(store, "closure", closure_row(2, replace(CLOSURE, to_ns=9)) | {"checksum": 0})
    assert len(list(closure_numbers(store, "closure"))) == 2
    assert [one.to_ns for one in closures_at(store, [1])] == [2]
    with pytest.raises(ValueError, match="closure 2: expected the checksum"):
        list(closures_at(store, [2]))


def test_of_what_is_named_twice_the_newest_is_found_and_no_more_is_read() -> None:
    one, other, none = (identity_of(replace(CLOSURE, to_ns=k)) for k in (1, 2, 3))
    numbers = iter([(one, 9), (other, 8), (one, 7), (other, 6)])
    assert numbers_among([other, one], numbers) == {one: 9, other: 8}
    assert next(numbers) == (one, 7)
    assert numbers_among([none], numbers) == numbers_among([], [(one, 9)]) == {}
