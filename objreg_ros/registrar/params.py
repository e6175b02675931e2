# SPDX-License-Identifier: Apache-2.0
"""The parameters of the registrar, and of its node."""

from __future__ import annotations

import math
from dataclasses import dataclass

from objreg_ros.keyframes.params import KeyframeParams
from objreg_ros.memory.params import MemoryParams
from objreg_ros.params import FramesParams, param, require_namespaces

GONE = {"waiting_megabytes": "it is fixed now: WAITING_BYTES in objreg_ros/registrar/node.py"}
OWN = "."  # in place of a robot's namespace: that of the registrar itself


@dataclass(frozen=True)
class RegistrarParams(KeyframeParams, MemoryParams):
    """The parameters of the registrar: its own, and those of keyframes, memory and registration."""

    closures: int = param(2, "accepted closures of one keyframe that end its search", ge=1, live=True)
    threads: int = param(2, "stored keyframes that are tried at once", ge=1, le=16)
    kidnapping_search: bool = param(
        False,
        "search for the camera wherever odometry has it, while that is in doubt, so that localisation_state knows one "
        "that was carried away; it takes up to two more registrations a keyframe, and gives no constraints",
        live=True,
    )
    confirm_seconds: float = param(
        10.0,
        "longest time that a likely pose waits for poses of other keyframes that agree by way of "
        "odometry; 0: a pair of keyframes proves itself or is refused",
        "s",
        ge=0.0,
    )


@dataclass(frozen=True)
class RegistrarNodeParams(FramesParams):
    """How the registrar's node brings its inputs together, and when it searches."""

    DROPPED = GONE

    robots: tuple[str, ...] = param(
        (),
        "robots whose keyframers send keyframes, by their namespaces (. for this node's own), each with those of its "
        "cameras behind it, as in 'robot1 front rear', where it has several; empty: one robot is followed here",
    )
    search_seconds: float = param(
        0.0, "longest search for one keyframe; 0: as long as it takes", "s", ge=0.0, live=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        robots = [entry.split() or [""] for entry in self.robots]
        require_namespaces("robots", ["own" if robot == OWN else robot for robot, *_ in robots])
        for robot, *cameras in robots:
            require_namespaces(f"robots: cameras of {robot}", cameras)

    @property
    def cameras(self) -> dict[str, tuple[str, ...]]:
        """The namespace of each robot, empty for this node's own, with those of its cameras below it, if they have."""
        robots = (entry.split() for entry in self.robots)
        return {"" if robot == OWN else robot: tuple(cameras) for robot, *cameras in robots}

    @property
    def limit(self) -> float:
        """The longest search in seconds, infinity if there is no limit."""
        return self.search_seconds or math.inf
