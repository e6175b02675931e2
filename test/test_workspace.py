# SPDX-License-Identifier: Apache-2.0
"""A clean colcon workspace builds both packages of this repository, with the paths that README names.

colcon stops at a package that it has found, and objreg_msgs lies inside of objreg_ros.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

MOST_S = 1800.0  # of a build: a Raspberry Pi takes ten minutes for the messages
NEEDED = ("ament_cmake", "rosidl_default_generators")  # what builds messages, in a prefix that the environment names
IMPORTS = (
    "import objreg_msgs, objreg_ros; from objreg_msgs.msg import LoopClosure; from objreg_msgs.srv import Relocalise; "
    "print(objreg_msgs.__file__)"
)


def is_there(package: str) -> bool:
    """Whether CMake would find an installed package."""
    prefixes = [os.environ.get(name, "").split(os.pathsep) for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")]
    return any(Path(prefix, "share", package, "cmake").is_dir() for paths in prefixes for prefix in paths if prefix)


@pytest.fixture
def workspace(tmp_path: Path, repository: Path) -> Path:
    """A workspace with this repository in it, and nothing built."""
    if shutil.which("colcon") is None:
        pytest.skip("colcon is not installed")
    (tmp_path / "src").mkdir()
    (tmp_path / "src/objreg_ros").symlink_to(repository)
    return tmp_path


@pytest.fixture
def workspace_with_messages(workspace: Path) -> Path:
    """A workspace on a machine that can build messages."""
    absent = [package for package in NEEDED if not is_there(package)]
    if absent:
        pytest.skip(f"{' and '.join(absent)} not installed: no messages can be built")
    return workspace


def told(workspace: Path, *words: str) -> str:
    done = subprocess.run(words, cwd=workspace, capture_output=True, text=True, timeout=MOST_S)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("how", [(), ("--symlink-install",)], ids=["copied", "linked"])
def test_a_clean_workspace_builds_both_packages(workspace_with_messages: Path, how: tuple[str, ...]) -> None:
    workspace = workspace_with_messages
    paths = ("--base-paths", "src/objreg_ros", "src/objreg_ros/objreg_msgs")
    assert told(workspace, "colcon", "list", "--names-only", *paths).split() == ["objreg_msgs", "objreg_ros"]
    told(workspace, "colcon", "build", *how, *paths)
    found = told(workspace, "bash", "-c", f". install/setup.bash && {sys.executable} -c '{IMPORTS}'").split()[-1]
    assert Path(found).is_relative_to(workspace / "install")


@pytest.mark.slow
@pytest.mark.parametrize("how", [(), ("--symlink-install",)], ids=["copied", "linked"])
def test_a_clean_workspace_builds_the_nodes_without_the_messages(workspace: Path, how: tuple[str, ...]) -> None:
    told(workspace, "colcon", "build", *how, "--base-paths", "src", "--packages-select", "objreg_ros")
    assert (workspace / "install/objreg_ros/share/objreg_ros/package.xml").exists()


def test_setup_runs_beside_a_link_to_it_as_colcon_makes_one(tmp_path: Path, repository: Path) -> None:
    (tmp_path / "setup.py").symlink_to(repository / "setup.py")
    shown = told(tmp_path, sys.executable, "setup.py", "--name")
    assert shown.split()[-1] == "objreg_ros"


def test_no_other_package_is_found_where_only_one_path_is_named(workspace: Path) -> None:
    found = told(workspace, "colcon", "list", "--names-only", "--base-paths", "src").split()
    assert found == ["objreg_ros"]  # why README names both


def test_both_packages_have_one_version(repository: Path) -> None:
    texts = [(repository / folder / "package.xml").read_text() for folder in ("", "objreg_msgs")]
    versions = {text.partition("<version>")[2].partition("<")[0] for text in texts}
    assert len(versions) == 1


def test_every_message_is_built(repository: Path) -> None:
    built = (repository / "objreg_msgs/CMakeLists.txt").read_text()
    for path in sorted((repository / "objreg_msgs").glob("*/*.[ms][sr][gv]")):
        assert f'"{path.parent.name}/{path.name}"' in built
