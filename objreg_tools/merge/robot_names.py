# SPDX-License-Identifier: Apache-2.0
"""The names of the robots of several stores in one: a name that two stores use is of two robots."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence, Set
from pathlib import Path

from objreg_ros.data.closures import framed


def robot_names(paths: Sequence[Path], robots: Sequence[Set[str]]) -> list[dict[str, str]]:
    """The new name of each robot of each store, by its name there.

    A name that one store alone uses stays. Of one that several use each gets the name of its store before it:
    ``robot1`` of ``east.db`` becomes ``east_robot1``, and a robot without a name ``east``.
    """
    used = Counter(robot for names in robots for robot in names)
    taken = {robot for robot, stores in used.items() if stores == 1}
    renamed: list[dict[str, str]] = []
    for path, names in zip(paths, robots, strict=True):
        renamed.append({})
        for robot in sorted(names):
            name = robot if used[robot] == 1 else _free(_joined(path, robot), taken)
            taken.add(name)
            renamed[-1][robot] = name
    return renamed


def renamed_frame(frame_id: str, robot: str, name: str) -> str:
    """A frame of a robot under the robot's new name."""
    return frame_id if robot == name else framed(name, frame_id.removeprefix(f"{robot}/") if robot else frame_id)


def _joined(path: Path, robot: str) -> str:
    """A name that a ROS namespace may have."""
    stem = re.sub(r"\W+", "_", path.stem, flags=re.ASCII).strip("_") or "store"
    name = f"{stem}_{robot}" if robot else stem
    return name if name[0].isalpha() else f"store_{name}"


def _free(name: str, taken: Set[str]) -> str:
    number, free = 1, name
    while free in taken:
        number, free = number + 1, f"{name}_{number + 1}"
    return free
