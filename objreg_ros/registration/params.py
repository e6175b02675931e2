# SPDX-License-Identifier: Apache-2.0
"""The parameters of the registrar."""

from __future__ import annotations

import math
from dataclasses import dataclass

from objreg_ros.params import MountedParams, Params, param, require_namespaces

GONE = {"waiting_megabytes": "it is fixed now: WAITING_BYTES in objreg_ros/registrar/node.py"}
OWN = "."  # in place of a robot's namespace: that of the registrar itself


@dataclass(frozen=True)
class KeyframeParams(Params):
    """What becomes a keyframe, and what it keeps; of the registrar, and of a keyframer that works for one elsewhere."""

    keyframe_translation: float = param(0.15, "motion that ends a keyframe", "m", ge=0.0, live=True)
    keyframe_rotation: float = param(8.0, "rotation that ends a keyframe", "deg", ge=0.0, le=180.0, live=True)
    keyframe_seconds: float = param(1.0, "longest time that a keyframe spans", "s", ge=0.0, live=True)
    max_speed: float = param(5.0, "odometry that leaps faster than this has begun anew: another session", "m/s", ge=0.1)
    context_range: float = param(4.0, "context farther from the camera is left out", "m", ge=0.5)
    label_groups: tuple[str, ...] = param(
        ("cup mouse bottle", "book remote cell_phone", "tv laptop"),
        "labels that detectors confuse: one group an item, spaces between (an underscore for a space in a name)",
    )


@dataclass(frozen=True)
class RegistrarParams(KeyframeParams):
    """The parameters of the registrar."""

    method: str = param(
        "objreg", "how keyframes are registered; paper is the founding point-to-point ICP", choices=("objreg", "paper")
    )
    seed: int = param(0, "seed of what a registration draws at random", ge=0)

    store: str = param("", "the SQLite file that remembers; empty: memory only, forgotten at the end", at_start=True)
    max_views: int = param(8, "views of one object that are kept, the most diverse", ge=1)
    max_keyframes: int = param(20000, "most keyframes that are kept; the oldest go first", ge=1)
    max_megabytes: float = param(10000.0, "largest store; the oldest keyframes go first", "MB", ge=1.0)

    # Which stored keyframes a new one is compared with.
    min_gap: float = param(2.0, "least time between the two keyframes of a constraint", "s", ge=0.0, live=True)
    odometry_radius: float = param(
        1.0, "stored objects of the session that odometry puts farther away are not tried", "m", ge=0.0, live=True
    )
    odometry_translation_noise: float = param(
        0.03, "standard deviation of odometry's position over no distance", "m", ge=0.0
    )
    odometry_rotation_noise: float = param(
        1.0, "standard deviation of odometry's rotation over no distance", "deg", ge=0.0
    )
    odometry_drift: float = param(
        0.1, "growth of the deviation of odometry's position with each metre of path", "m/m", ge=0.0
    )
    odometry_rotation_drift: float = param(
        0.05, "growth of the deviation of odometry's rotation with each degree turned", "deg/deg", ge=0.0
    )
    thin_seconds: float = param(1.0, "two closures are one if both their ends are nearer than this", "s", ge=0.0)
    closures: int = param(2, "accepted closures of one keyframe that end its search", ge=1, live=True)
    threads: int = param(2, "stored keyframes that are tried at once", ge=1, le=16)
    candidates: int = param(4, "stored keyframes that are tried for each new one, best first", ge=1, le=100, live=True)

    # What decides a closure.
    least_odds: float = param(
        75.0,
        "right poses for each false one, among poses as sure as the least sure that is accepted",
        ge=1.0,
        le=1e6,
        live=True,
    )
    confirm_seconds: float = param(
        10.0,
        "longest time that a likely pose waits for poses of other keyframes that agree by way of "
        "odometry; 0: a pair of keyframes proves itself or is refused",
        "s",
        ge=0.0,
    )
    max_translation: float = param(5.0, "largest distance between the two cameras", "m", ge=0.0)

    # How wrong an accepted pose may be; config/covariance.yaml says how these were calibrated.
    covariance_scale: float = param(
        0.45, "factor of the covariance, of a registration with a view score of 1 and an rmse of 6.5 mm", ge=0.0
    )
    covariance_calibration: float = param(
        0.035, "error of a motion, as a share of it, by a camera that is not quite as its calibration says", ge=0.0
    )


@dataclass(frozen=True)
class FramesParams(MountedParams):
    """How frames are brought together with odometry."""

    odom_slop: float = param(
        0.02,
        "largest distance in time between a frame and its odometry, unless two within seven times it enclose the frame",
        "s",
        ge=0.0,
    )


@dataclass(frozen=True)
class KeyframerNodeParams(FramesParams):
    """What a keyframer sends."""

    kilobytes: int = param(
        100,
        "most that a keyframe takes on the air; its objects are thinned where it would take more",
        "kB",
        ge=10,
        live=True,
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
