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
MESSAGES = (
    "import objreg_msgs; from objreg_msgs.msg import LoopClosure; from objreg_msgs.srv import Relocalise, Where; "
    "print(objreg_msgs.__file__)"
)
KERNELS = (
    'import sys; from objreg_ros.native import chosen_build, kernels; kernels("rvl"); '
    'print(sys.modules[f"objreg_ros.native.{chosen_build()}"].__file__)'
)
LEFT_OUT = (".*", "*.so", "*.egg-info", "__pycache__", "build", "install", "log", "out", "site")
BOTH = pytest.mark.parametrize("how", [(), ("--symlink-install",)], ids=["copied", "linked"])


def is_there(package: str) -> bool:
    """Whether CMake would find an installed package."""
    prefixes = [os.environ.get(name, "").split(os.pathsep) for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")]
    return any(Path(prefix, "share", package, "cmake").is_dir() for paths in prefixes for prefix in paths if prefix)


@pytest.fixture
def workspace(tmp_path: Path, repository: Path) -> Path:
    """A workspace with this repository in it, and nothing built."""
    if shutil.which("colcon") is None:
        pytest.skip("colcon is not installed")
    shutil.copytree(repository, tmp_path / "src/objreg_ros", ignore=shutil.ignore_patterns(*LEFT_OUT))
    return tmp_path


@pytest.fixture
def workspace_with_messages(workspace: Path) -> Path:
    """A workspace on a machine that can build messages."""
    absent = [package for package in NEEDED if not is_there(package)]
    if absent:
        pytest.skip(f"{' and '.join(absent)} not installed: no messages can be built")
    return workspace


def output_of(workspace: Path, *command: str) -> str:
    outside = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "OBJREG_CHECKED"}}
    done = subprocess.run(command, cwd=workspace, env=outside, capture_output=True, text=True, timeout=MOST_S)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def printed_after_setup(workspace: Path, program: str) -> Path:
    """The path that a program prints where the install space is sourced."""
    return Path(
        output_of(workspace, "bash", "-c", f". install/setup.bash && {sys.executable} -c '{program}'").split()[-1]
    )


def assert_kernels_are_of(workspace: Path, linked: bool) -> None:
    """A link leads to build/, and from there to the sources: nothing of the checkout under test."""
    found = printed_after_setup(workspace, KERNELS)
    assert found.is_relative_to(workspace / ("build" if linked else "install")), found
    assert found.resolve().is_relative_to(workspace), found


@pytest.mark.slow
@BOTH
def test_a_clean_workspace_builds_both_packages(workspace_with_messages: Path, how: tuple[str, ...]) -> None:
    workspace = workspace_with_messages
    paths = ("--base-paths", "src/objreg_ros", "src/objreg_ros/objreg_msgs")
    assert output_of(workspace, "colcon", "list", "--names-only", *paths).split() == ["objreg_msgs", "objreg_ros"]
    output_of(workspace, "colcon", "build", *how, *paths)
    assert printed_after_setup(workspace, MESSAGES).is_relative_to(workspace / "install")
    assert_kernels_are_of(workspace, linked=bool(how))


@pytest.mark.slow
@BOTH
def test_a_clean_workspace_builds_the_nodes_without_the_messages(workspace: Path, how: tuple[str, ...]) -> None:
    output_of(workspace, "colcon", "build", *how, "--base-paths", "src", "--packages-select", "objreg_ros")
    assert (workspace / "install/objreg_ros/share/objreg_ros/package.xml").exists()
    assert_kernels_are_of(workspace, linked=bool(how))


def test_a_header_that_is_gone_is_gone_from_the_next_build(tmp_path: Path, repository: Path) -> None:
    old, kept = (tmp_path / f"objreg_ros/native/{name}" for name in ("gone.hpp", "array.hpp"))
    old.parent.mkdir(parents=True)
    old.touch()
    output_of(repository, sys.executable, "setup.py", "--quiet", "build_py", "--build-lib", str(tmp_path))
    assert kept.exists() and not old.exists()


def test_setup_runs_beside_a_link_to_it_as_colcon_makes_one(tmp_path: Path, repository: Path) -> None:
    (tmp_path / "setup.py").symlink_to(repository / "setup.py")
    shown = output_of(tmp_path, sys.executable, "setup.py", "--name")
    assert shown.split()[-1] == "objreg_ros"


def test_no_other_package_is_found_where_only_one_path_is_named(workspace: Path) -> None:
    found = output_of(workspace, "colcon", "list", "--names-only", "--base-paths", "src").split()
    assert found == ["objreg_ros"]  # why README names both


def test_both_packages_have_one_version(repository: Path) -> None:
    texts = [(repository / folder / "package.xml").read_text() for folder in ("", "objreg_msgs")]
    versions = {text.partition("<version>")[2].partition("<")[0] for text in texts}
    assert len(versions) == 1


def test_every_message_is_built(repository: Path) -> None:
    built = (repository / "objreg_msgs/CMakeLists.txt").read_text()
    for path in sorted((repository / "objreg_msgs").glob("*/*.[ms][sr][gv]")):
        assert f'"{path.parent.name}/{path.name}"' in built
