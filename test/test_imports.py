# SPDX-License-Identifier: Apache-2.0
"""What is heavy is loaded where it is used, not where the package or a node is imported."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("distributed", "gtsam", "matplotlib", "numba", "open3d", "plotly", "prometheus_client", "pyarrow", "rerun")
EXTRAS = ("click", "gtsam", "jinja2", "matplotlib", "open3d", "plotly", "rosbags", "tqdm")
NODES = (*(f"objreg_ros.{stage}" for stage in ("detector", "segmenter", "registrar", "keyframes")), "objreg_mapper")
CODE = "import importlib, sys; importlib.import_module(sys.argv[1]); print(*(set(sys.argv[2:]) & set(sys.modules)))"


def heavy_after(module: str) -> str:
    """Which heavy libraries a fresh process has loaded after the import of ``module``."""
    command = [sys.executable, "-c", CODE, module, *HEAVY]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize(
    "module",
    ["objreg_ros", "objreg_ros.registration", "objreg_ros.segmenter.segment", "objreg_ros.registrar.registrar",
     "objreg_tools.cli.commands.offline", "objreg_tools.cli.commands.batch", "objreg_tools.cli.commands.demo",
     "objreg_tools.cli.commands.metrics",
     "objreg_tools.report.exports.export"],
)  # fmt: skip
def test_a_module_loads_nothing_heavy_when_it_is_imported(module: str) -> None:
    assert heavy_after(module) == ""


@pytest.mark.parametrize("package", NODES)
def test_a_node_loads_nothing_heavy_when_it_is_imported(package: str) -> None:
    pytest.importorskip("rclpy")
    assert heavy_after(f"{package}.node") == ""


def test_the_robots_part_is_imported_without_what_only_extras_bring() -> None:
    pytest.importorskip("rclpy")
    code = (
        "import importlib, pkgutil, sys\n"
        f"for name in {EXTRAS!r}: sys.modules[name] = None\n"
        "import objreg_ros\n"
        "names = [m.name for m in pkgutil.walk_packages(objreg_ros.__path__, 'objreg_ros.')]\n"
        "for name in names: importlib.import_module(name)\n"
        "assert not [name for name in sys.modules if name.startswith(('objreg_mapper', 'objreg_tools'))]\n"
        "print(len(names))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) > 200


def test_the_command_without_its_tools_names_the_extra() -> None:
    code = "import sys; sys.modules['click'] = None; from objreg_tools.__main__ import main; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1 and "pip install 'objreg_ros[tools]'" in done.stderr
