# SPDX-License-Identifier: Apache-2.0
"""A SLAM engineer beside a live graph."""

from __future__ import annotations

from pathlib import Path

import pytest

pytestmark = pytest.mark.ros


def test_an_engineer_receives_constraints_refusals_and_diagnostics_of_a_robot(
    room: Path, tmp_path: Path, domain: int
) -> None:
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from ros.graph import Graph

    from . import engineer

    graph = Graph(domain, tmp_path)
    try:
        engineer.walk(graph, tmp_path, room)
    finally:
        graph.close()
