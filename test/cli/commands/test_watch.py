# SPDX-License-Identifier: Apache-2.0
"""The command line of `objreg watch`; test/ros/test_watch.py has it beside a graph."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from objreg_tools.cli.commands.watch import command


@pytest.mark.parametrize("remap", ["image", "image:=", ":=/camera/image"])
def test_a_remap_without_its_two_names_is_refused(remap: str) -> None:
    result = CliRunner().invoke(command, ["--port", "0", "--remap", remap])
    assert isinstance(result.exception, ValueError) and "expected NAME:=TOPIC" in str(result.exception)


@pytest.mark.ros
def test_names_that_ros_does_not_take_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    result = CliRunner().invoke(command, ["--port", "0", "--namespace", "a robot"])
    assert isinstance(result.exception, ValueError) and "expected names that ROS takes" in str(result.exception)
