# SPDX-License-Identifier: Apache-2.0
"""The command line of `objreg metrics`; test/ros/test_metrics.py has it beside a graph."""

from __future__ import annotations

import sys

import pytest
from click.testing import CliRunner

from objreg_tools.cli.commands.metrics import command


def test_without_the_client_it_ends_with_the_extra_that_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    result = CliRunner().invoke(command, ["--port", "0"])
    assert isinstance(result.exception, ValueError) and "objreg_ros[metrics]" in str(result.exception)


@pytest.mark.parametrize("port", ["-1", "65536", "all"])
def test_a_port_that_is_none_is_refused(port: str) -> None:
    assert CliRunner().invoke(command, ["--port", port]).exit_code == 2
