# SPDX-License-Identifier: Apache-2.0
"""The parameters that the last release had: each is refused with the name of the constant that took its place."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module

import pytest

from objreg_ros.cli.settings import NODES, names_of, read_settings
from objreg_ros.registration.dropped import CONSTANT_OF, DROPPED
from objreg_ros.registration.params import RegistrarNodeParams, RegistrarParams


@pytest.mark.parametrize("file", CONSTANT_OF)
def test_each_constant_that_is_named_is_in_its_file(file: str) -> None:
    if file.endswith("/node.py"):
        pytest.importorskip("rclpy", reason="a node needs ROS")
    module = import_module(f"objreg_ros.{file.removesuffix('.py').replace('/', '.')}")
    for constant in CONSTANT_OF[file].values():
        owner, _, field = constant.rpartition(".")
        assert hasattr(module, constant) if not owner else field in getattr(module, owner)._fields, constant


@pytest.mark.parametrize("name", DROPPED)
def test_a_dropped_parameter_is_refused_with_the_name_of_its_constant(name: str) -> None:
    (constant,) = (constants[name] for constants in CONSTANT_OF.values() if name in constants)
    with pytest.raises(ValueError) as refused:
        RegistrarParams.from_mapping({name: 1.0})
    assert str(refused.value).startswith(f"{name}: no parameter any more; ") and f" {constant} in " in str(
        refused.value
    )


def test_a_dropped_parameter_is_refused_on_the_command_line_with_the_name_of_its_constant() -> None:
    with pytest.raises(ValueError, match=r"^registrar: min_score: .* LEAST_SCORE in objreg_ros/.*view_score\.py$"):
        read_settings(None, ["registrar.min_score=0.2"])


def test_no_dropped_name_is_a_parameter() -> None:
    assert not set(DROPPED) & {name for kind in NODES["registrar"] for name in names_of(kind)}
    assert not set(DROPPED) & {field.name for kind in (RegistrarParams, RegistrarNodeParams) for field in fields(kind)}
