# SPDX-License-Identifier: Apache-2.0
"""The parameters of other nodes as plain values."""

from __future__ import annotations

from rclpy.parameter import Parameter

from objreg_ros.bridge.process.other_nodes import ParameterReader, values_of


def test_values_are_plain_and_what_is_not_set_is_left_out() -> None:
    given = {"a": True, "b": 2, "c": 0.5, "d": "x", "e": [1.0, 2.0], "f": ["y"], "g": None}
    messages = [Parameter(name, value=value).get_parameter_value() for name, value in given.items()]
    assert values_of(given, messages) == {name: value for name, value in given.items() if value is not None}


def test_the_versions_name_python_and_this_package() -> None:
    assert {"python", "numpy"} <= ParameterReader.versions().keys()
