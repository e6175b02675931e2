# SPDX-License-Identifier: Apache-2.0
"""What is heavy is loaded where it is used, not where the package or a node is imported."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("distributed", "gtsam", "matplotlib", "open3d", "plotly", "pyarrow", "rerun")
NODES = ("detector", "segmenter", "registrar", "keyframes", "mapper")
CODE = "import importlib, sys; importlib.import_module(sys.argv[1]); print(*(set(sys.argv[2:]) & set(sys.modules)))"


def heavy_after(module: str) -> str:
    """Which heavy libraries a fresh process has loaded after the import of ``module``."""
    words = [sys.executable, "-c", CODE, module, *HEAVY]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize(
    "module",
    ["objreg_ros", "objreg_ros.registration", "objreg_ros.segmenter.segment", "objreg_ros.registrar.registrar",
     "objreg_ros.cli.offline", "objreg_ros.cli.batch", "objreg_ros.report.exports.export", "objreg_ros.cli.demo"],
)  # fmt: skip
def test_a_module_loads_nothing_heavy_when_it_is_imported(module: str) -> None:
    assert heavy_after(module) == ""


@pytest.mark.parametrize("room", NODES)
def test_a_node_loads_nothing_heavy_when_it_is_imported(room: str) -> None:
    pytest.importorskip("rclpy")
    assert heavy_after(f"objreg_ros.{room}.node") == ""
