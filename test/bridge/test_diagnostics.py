# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="the messages of ROS 2 are not installed")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from objreg_ros.bridge.diagnostics import balance_of, connected_of, diagnostic
from objreg_ros.bridge.ledger import Balance

BOOKS = Balance(
    received=10,
    published=6,
    waiting=1,
    dropped={"overtaken": 2, "malformed_image": 1},
    lost={"image": 3},
    stage_ms={"detect": (8.25, 9.5), "total": (10.0, 20.0)},
)


def status(silent: dict[str, str]) -> DiagnosticStatus:
    return diagnostic("/detector", Time(sec=4), BOOKS, 29.97, silent, {"stored keyframes": 7}).status[0]


def test_the_books_survive_the_way_over_the_wire() -> None:
    assert balance_of(status({})) == BOOKS


def test_the_connections_of_a_node_are_told_by_topic() -> None:
    told = diagnostic("/detector", Time(), BOOKS, 0.0, {}, {"connected: /image": 1, "connected: /labels": 0})
    assert connected_of(told.status[0]) == {"/image": 1, "/labels": 0}


def test_what_a_node_adds_is_shown() -> None:
    values = {pair.key: pair.value for pair in status({}).values}
    assert values["stored keyframes"] == "7" and values["rate [Hz]"] == "29.97"


def test_a_silent_input_makes_a_warning_that_names_it() -> None:
    assert status({}).level == DiagnosticStatus.OK and status({}).message == "30.0 frames/s"
    warned = status({"image": "nothing on /image for 5 s"})
    assert warned.level == DiagnosticStatus.WARN and warned.message == "nothing on /image for 5 s"
