# SPDX-License-Identifier: Apache-2.0
"""Every key of package.xml leads to something that Ubuntu 24.04 (noble) with Jazzy can install.

Every key was looked up in rosdistro at 8468e88: `rosdep/base.yaml` and `rosdep/python.yaml` for the system's packages
and pip's, and `jazzy/distribution.yaml` for ROS's, where it must be released. A rosdep key seldom says in which Ubuntu
its package is, so look at packages.ubuntu.com/noble too. The versions in the table are those that noble is known by,
not read from its archive: the workflow for Ubuntu 24.04, which installs them, is the proof.
To add a key, look it up in all of these, then write it here.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

RELEASED_IN_JAZZY = {
    "ament_index_python", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "launch", "launch_ros", "nav_msgs",
    "rcl_interfaces", "rclpy", "rosgraph_msgs", "sensor_msgs", "std_msgs", "std_srvs", "tf2_msgs", "tf2_ros_py",
    "vision_msgs", "visualization_msgs",
}  # fmt: skip
BUILDS_MESSAGES = {"ament_cmake", "rosidl_default_generators", "rosidl_default_runtime"}  # released in Jazzy too
HERE = {"objreg_msgs"}  # in this repository: rosdep and colcon are given its folder
IN_NOBLE = {  # key → what it leads to: a package of Ubuntu with its version, or one of PyPI
    "g++-static": "g++ 13.2.0",
    "python3-click": "python3-click 8.1.6",
    "python3-dev": "python3-dev 3.12.3",
    "python3-hypothesis": "python3-hypothesis 6.98.15",
    "python3-jinja2": "python3-jinja2 3.1.2",
    "python3-matplotlib": "python3-matplotlib 3.6.3",
    "python3-numpy": "python3-numpy 1.26.4",
    "python3-onnxruntime-pip": "pip: onnxruntime",
    "python3-open3d-pip": "pip: open3d",
    "python3-opencv": "python3-opencv 4.6.0",
    "python3-pil": "python3-pil 10.2.0",
    "python3-pytest": "python3-pytest 7.4.4",
    "python3-rosbags-pip": "pip: rosbags",
    "python3-scipy": "python3-scipy 1.11.4",
    "python3-tqdm": "python3-tqdm 4.66.2",
    "python3-yaml": "python3-yaml 6.0.1",
}
ON_A_ROBOT = ("tools", "paper")  # the extras that package.xml brings
OTHER_NAMES = {"opencv-python-headless": "opencv", "pillow": "pil", "pyyaml": "yaml"}


def keys(repository: Path) -> list[str]:
    root = ElementTree.parse(repository / "package.xml").getroot()
    return [element.text or "" for element in root if element.tag.endswith("depend")]


def asked(repository: Path, keyword: str) -> Any:
    """What setup.py says behind a keyword."""
    (value,) = [
        ast.literal_eval(node.value)
        for node in ast.walk(ast.parse((repository / "setup.py").read_text()))
        if isinstance(node, ast.keyword) and node.arg == keyword
    ]
    return value


def required(repository: Path, *extras: str) -> dict[str, str]:
    """The packages that setup.py asks for, those of the extras too, each with its oldest version."""
    extra_lines = asked(repository, "extras_require")
    wanted = [*asked(repository, "install_requires"), *(line for extra in extras for line in extra_lines[extra])]
    return {name: oldest for name, _, oldest in (line.partition(">=") for line in wanted) if name != "setuptools"}


def version(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split("."))


def test_no_key_is_named_that_nobody_has_looked_up_and_none_twice(repository: Path) -> None:
    named = keys(repository)
    assert sorted(named) == sorted(RELEASED_IN_JAZZY | HERE | set(IN_NOBLE))


def test_messages_need_only_what_jazzy_has_released(repository: Path) -> None:
    assert set(keys(repository / "objreg_msgs")) <= RELEASED_IN_JAZZY | BUILDS_MESSAGES


def test_whatever_setup_py_asks_for_comes_with_a_robot_too(repository: Path) -> None:
    for name in required(repository, *ON_A_ROBOT):
        key = f"python3-{OTHER_NAMES.get(name, name)}"
        assert key in IN_NOBLE or f"{key}-pip" in IN_NOBLE, name


def test_nobles_version_is_one_that_setup_py_takes(repository: Path) -> None:
    for key in [key for key, package in IN_NOBLE.items() if not package.startswith("pip: ")]:
        oldest = {
            f"python3-{OTHER_NAMES.get(name, name)}": text
            for name, text in required(repository, *ON_A_ROBOT, "report").items()
        }
        assert version(IN_NOBLE[key].split()[1]) >= version(oldest.get(key, "0")), key


def test_a_robot_is_asked_for_nothing_that_only_drawings_need(repository: Path) -> None:
    root = ElementTree.parse(repository / "package.xml").getroot()
    on_robot = {element.text for element in root.iter("exec_depend")}
    only = set(required(repository, "report")) - set(required(repository))
    assert only == {"matplotlib", "plotly"} and not {f"python3-{name}" for name in only} & on_robot
