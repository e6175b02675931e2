# SPDX-License-Identifier: Apache-2.0
"""The file that others read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objreg_mapper.adapters.g2o import ToG2o
from objreg_mapper.constraint import Constraint, compensated, local_information
from objreg_ros.bridge.messages import closures_msg, to_msg
from objreg_ros.data.frames import Odometry
from objreg_ros.diagnostics import by_key
from objreg_ros.geometry import inverse, pose, rotation_from_quaternion

from .standing_by import AHEAD, AHEAD_TEXT, COVARIANCE, MEASURED, body_at, closure


def edges(path: Path, apart: int = 2) -> list[list[float]]:
    """The numbers of the edges between vertices that are no neighbours."""
    lines = [line.split()[1:] for line in path.read_text().splitlines() if line.startswith("EDGE")]
    return [[float(number) for number in line] for line in lines if int(line[1]) - int(line[0]) >= apart]


def test_odometry_and_constraints_are_in_the_file_number_by_number(around: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "graph.g2o"
    graph = around(f"graph_path:={path}", "period:=0.2", f"T_base_camera:={AHEAD_TEXT}", "keyframe_translation:=0.04")
    node = graph.start(ToG2o)
    graph.send(closure(1.5, 9.0))
    graph.drive(node, 0.0, 10.0)
    graph.wait(lambda: path.exists() and edges(path))
    vertices = [line.split() for line in path.read_text().splitlines() if line.startswith("VERTEX")]
    np.testing.assert_allclose(float(vertices[3][2]), body_at(1.5)[0, 3], atol=1e-9)
    ((k1, k2, *numbers),) = edges(path)
    assert (k1, k2) == (3, 18)  # odometry has a pose at either moment
    written = pose(rotation_from_quaternion(np.array(numbers[3:7])), np.array(numbers[:3]))
    expected = compensated(Constraint(MEASURED, COVARIANCE), AHEAD, inverse(AHEAD))
    np.testing.assert_allclose(written, expected.T_from_to, atol=1e-8)
    information = local_information(expected)[np.triu_indices(6)]
    np.testing.assert_allclose(numbers[7:], information, rtol=1e-7, atol=1e-4)
    assert node.accounting.balance().published == 1 and not list(tmp_path.glob(".*.part"))


def test_a_retraction_takes_the_edge_out_of_the_file_again(around: Callable[..., Any], tmp_path: Path) -> None:
    if closures_msg.LoopClosureMsg is None:
        pytest.skip("objreg_msgs is not installed: colcon builds it from this repository")
    path = tmp_path / "graph.g2o"
    graph = around(f"graph_path:={path}", "period:=0.1", f"T_base_camera:={AHEAD_TEXT}")
    node = graph.start(ToG2o)
    graph.send(closure(1.5, 9.0))
    message = closures_msg.loop_closure(closure(1.5, 9.0))
    graph.whole.publish(message)
    graph.drive(node, 0.0, 10.0)
    graph.wait(lambda: path.exists() and edges(path))
    graph.wait(lambda: by_key(*node.own_diagnostics())["repeated"] == 1)
    message.retracted = True
    graph.whole.publish(message)
    graph.wait(lambda: not edges(path))
    assert node.accounting.balance().published == 1 and by_key(*node.own_diagnostics())["retracted too late"] == 0
    message.retracted = False
    graph.whole.publish(message)
    graph.wait(lambda: edges(path))
    graph.whole.publish(message)
    graph.wait(lambda: by_key(*node.own_diagnostics())["repeated"] == 2)
    assert len(edges(path)) == 1


def test_odometry_that_begins_anew_begins_another_file(around: Callable[..., Any], tmp_path: Path) -> None:
    graph = around(f"graph_path:={tmp_path}/graph.g2o", "period:=0.1")
    node = graph.start(ToG2o)
    graph.drive(node, 50.0, 53.0)
    before = (tmp_path / "graph.g2o").read_text() if (tmp_path / "graph.g2o").exists() else ""
    for seconds in (1.0, 1.5, 2.0, 2.5, 3.0):
        sample = Odometry(T_odom_body=body_at(seconds), stamp_ns=round(seconds * 1e9), child_frame_id="base_link")
        graph.odom.publish(to_msg.odometry(sample))
    graph.wait(lambda: (tmp_path / "graph_1.g2o").exists())
    assert (tmp_path / "graph.g2o").read_text().startswith(before) and node.path.name == "graph_1.g2o"


def test_what_cannot_be_tied_is_dropped_by_reason(around: Callable[..., Any], tmp_path: Path) -> None:
    graph = around(f"graph_path:={tmp_path}/graph.g2o", f"T_base_camera:={AHEAD_TEXT}")
    node = graph.start(ToG2o)
    graph.drive(node, 5.0, 10.0)
    graph.send(closure(1.5, 9.0), closure(9.0, 6.0))
    graph.wait(lambda: node.accounting.balance().dropped == {"before_odometry": 1, "two_clocks": 1})


def test_a_folder_that_is_not_there_is_refused_at_start(around: Callable[..., Any], tmp_path: Path) -> None:
    around(f"graph_path:={tmp_path}/none/graph.g2o")
    with pytest.raises(ValueError, match="expected a file in a folder that is there"):
        ToG2o()
