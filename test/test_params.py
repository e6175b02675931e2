# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass

import numpy as np
import pytest

from objreg_ros.params import Params, param
from objreg_ros.registrar.params import RegistrarNodeParams


@dataclass(frozen=True)
class OvenParams(Params):
    heat: float = param(180.0, "how hot", unit="°C", ge=0.0, le=250.0, live=True)
    trays: int = param(2, "how many", ge=1)
    mode: str = param("air", "which fan", choices=("air", "grill"))
    light: bool = param(True, "whether it is lit")
    marks: tuple[float, ...] = param((1.0, 2.0), "where the racks are")
    names: tuple[str, ...] = param((), "what the racks are called")
    cold: float = param(-5.0, "how cold", le=0.0)


def test_defaults_hold_and_are_frozen() -> None:
    oven = OvenParams()
    assert (oven.heat, oven.trays, oven.mode, oven.marks) == (180.0, 2, "air", (1.0, 2.0))
    with pytest.raises(FrozenInstanceError):
        oven.heat = 1.0  # type: ignore[misc]


def test_a_declaration_states_everything_once() -> None:
    heat, trays, mode, *_, cold = OvenParams.declarations()
    assert (heat.name, heat.kind, heat.unit, heat.doc, heat.live) == ("heat", float, "°C", "how hot", True)
    assert (heat.range_text, trays.range_text, mode.range_text) == ("0 … 250", "at least 1", "air | grill")
    assert cold.range_text == "at most 0" and not cold.live


def test_lists_are_distinguished_from_single_values() -> None:
    kinds = {d.name: (d.kind, d.many) for d in OvenParams.declarations()}
    assert kinds["marks"] == (float, True) and kinds["names"] == (str, True) and kinds["trays"] == (int, False)


@pytest.mark.parametrize("marks", [[3, 4.5], (3.0, 4.5), np.array([3.0, 4.5])])
def test_a_list_of_any_kind_becomes_a_tuple_of_the_declared_type(marks: object) -> None:
    marks = OvenParams.from_mapping({"marks": marks}).marks
    assert marks == (3.0, 4.5) and all(type(mark) is float for mark in marks)


def test_a_whole_number_is_good_for_a_float() -> None:
    assert type(OvenParams(heat=200).heat) is float


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"heat": 251}, "heat: expected 0 … 250, got 251.0"),
        ({"heat": -1.0}, "heat: expected 0 … 250, got -1.0"),
        ({"heat": float("nan")}, "heat: expected a finite number, got nan"),
        ({"cold": float("-inf")}, "cold: expected a finite number, got -inf"),
        ({"heat": "hot"}, "heat: expected float, got 'hot'"),
        ({"heat": True}, "heat: expected float, got True"),
        ({"trays": 0}, "trays: expected at least 1, got 0"),
        ({"trays": 2.0}, "trays: expected int, got 2.0"),
        ({"trays": True}, "trays: expected int, got True"),
        ({"mode": "steam"}, "mode: expected one of air, grill, got 'steam'"),
        ({"light": 1}, "light: expected bool, got 1"),
        ({"marks": 3.0}, "marks: expected a list of float, got 3.0"),
        ({"marks": ["a"]}, "marks: expected float, got 'a'"),
        ({"names": "abc"}, "names: expected a list of str, got 'abc'"),
    ],
)
def test_what_cannot_be_is_refused_with_expected_and_got(change: dict, complaint: str) -> None:
    with pytest.raises(ValueError) as refused:
        OvenParams.from_mapping(change)
    assert str(refused.value) == complaint


def test_a_name_that_is_not_declared_is_refused_with_those_that_are() -> None:
    with pytest.raises(ValueError, match="OvenParams: no parameter head, speed; there are heat, trays, mode"):
        OvenParams.from_mapping({"speed": 1, "head": 2})


def test_a_copy_is_checked_again_and_leaves_the_first_alone() -> None:
    oven = OvenParams()
    assert oven.replaced(trays=3).trays == 3 and oven.trays == 2
    with pytest.raises(ValueError, match="trays: expected at least 1"):
        oven.replaced(trays=0)


def test_a_default_out_of_its_own_range_shows_at_once() -> None:
    @dataclass(frozen=True)
    class WrongParams(Params):
        size: float = param(2.0, "too large", le=1.0)

    with pytest.raises(ValueError, match="size: expected at most 1"):
        WrongParams()


@pytest.mark.parametrize("kind", [dict, float | None, complex])
def test_a_type_that_ros_has_not_cannot_be_a_parameter(kind: object) -> None:
    wrong = dataclass(frozen=True)(type("Wrong", (Params,), {"__annotations__": {"x": kind}, "x": param(None, "?")}))
    with pytest.raises(TypeError, match="a parameter is bool, int, float, str or a tuple of one"):
        wrong.declarations()


def test_auto_stands_for_a_mount_that_nothing_says() -> None:
    assert RegistrarNodeParams(T_base_camera="auto").mounting is None  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="expected a list of float, got 'somewhere'"):
        RegistrarNodeParams(T_base_camera="somewhere")  # type: ignore[arg-type]
