# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import time

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.common import CommonDiagnostics
from objreg_ros.bridge.node.diagnostics import diagnostic
from objreg_tools.cli.watching.reports import SILENT_S, NodeReport, report_of

COUNTERS = Balance(10, 6, 1, {"overtaken": 3}, {"/image": 2}, {"total": (10.0, 20.0)})


def status(troubles: tuple[str, ...], **others: object) -> DiagnosticStatus:
    made = CommonDiagnostics.of(COUNTERS, 3.0, **others)
    (one,) = diagnostic("/robot1/registrar", Time(), troubles, made).status
    return one


def test_a_report_has_what_the_node_counted_refused_and_found() -> None:
    given = status(("off",), found={"wrong-scale": "5 %", "wrong-camera": "8 %"})
    given.values += [KeyValue(key="rejected: no_candidate", value="7"), KeyValue(key="constraints", value="4")]
    reported = report_of(given)
    assert reported is not None
    name, made = reported
    assert (name, made.balance, made.warns, made.message) == ("/robot1/registrar", COUNTERS, True, "off")
    assert (made.rejected, made.counts) == ({"no_candidate": 7}, {"constraints": "4"})
    assert made.found == ("wrong-camera", "wrong-scale")


def test_a_node_without_trouble_does_not_warn_and_finds_nothing() -> None:
    reported = report_of(status(()))
    assert reported is not None and not reported[1].warns and reported[1].found == ()


def test_a_status_of_another_program_is_none_of_ours() -> None:
    assert report_of(DiagnosticStatus(name="/camera: driver", hardware_id="kinect")) is None


@pytest.mark.parametrize("values", [[], [KeyValue(key="received", value="many")]])
def test_a_report_without_its_counters_is_refused(values: list[KeyValue]) -> None:
    with pytest.raises((ValueError, KeyError)):
        report_of(DiagnosticStatus(name="x: frames", hardware_id="objreg_ros", values=values))


def test_a_node_that_has_not_reported_for_a_while_is_silent() -> None:
    now_s = time.monotonic()
    assert not NodeReport(COUNTERS, False, "", at_s=now_s).is_silent()
    assert NodeReport(COUNTERS, False, "", at_s=now_s - SILENT_S - 1.0).is_silent()
