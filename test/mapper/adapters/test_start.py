# SPDX-License-Identifier: Apache-2.0
"""The nodes as processes: they start, say in a line what they lack, and end with a signal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros

MODULES = {"rtabmap": "rtabmap_msgs", "hydra": "pose_graph_tools_msgs", "lio_sam": "", "g2o": ""}
START_S = 60


def environment(folder: Path) -> dict[str, str]:
    return {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOG_DIR": str(folder)}


@pytest.mark.parametrize("name", MODULES)
def test_a_node_starts_or_says_what_to_install_and_ends_with_a_signal(name: str, tmp_path: Path) -> None:
    if find_spec("rclpy") is None:
        pytest.skip("rclpy is not installed")
    command = [sys.executable, "-m", f"objreg_mapper.adapters.{name}", "--ros-args", "-p", "silence:=5.0"]
    if name == "g2o":
        command += ["-p", f"graph_path:={tmp_path}/graph.g2o"]
    node = subprocess.Popen(command, env=environment(tmp_path), stderr=subprocess.PIPE, text=True)
    needed = MODULES[name]
    if needed and find_spec(needed) is None:
        _, said = node.communicate(timeout=START_S)
        assert node.returncode == 1 and len(said.strip().splitlines()) == 1 and needed in said
        return
    assert node.stderr is not None
    line = ""
    while "Fast DDS" not in line and "check yourself" not in line:  # its first line, once it spins
        line = node.stderr.readline()
        assert line, "it ended by itself"
    node.send_signal(signal.SIGTERM)
    _, said = node.communicate(timeout=START_S)
    assert node.returncode == 0 and "Traceback" not in said
