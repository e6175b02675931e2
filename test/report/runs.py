# SPDX-License-Identifier: Apache-2.0
"""The JSON of a run that never was: a camera that walks a circle twice, with drift, past two cups and a book."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_tools.truth import Truth

COUNT = 120
STEP_NS = 100_000_000
OBJECTS = (("cup", (1.5, 0.0, 0.0)), ("cup", (-1.5, 0.0, 0.0)), ("book", (0.0, 1.5, 0.2)))


def true_pose(k: int) -> np.ndarray:
    turn = rotation_from_vector(np.array([0.0, 0.0, 4 * np.pi * k / COUNT]))
    return pose(turn, turn @ np.array([1.0, 0.0, 0.0]))


TRUE = [true_pose(k) for k in range(COUNT)]
TRUTH = Truth((k * STEP_NS, T) for k, T in enumerate(TRUE))


def odometry() -> list[np.ndarray]:
    drift = pose(rotation_from_vector(np.array([0.0, 0.0, 0.004])), np.array([0.002, 0.0, 0.0]))
    poses = [np.eye(4)]
    for a, b in pairwise(TRUE):
        poses.append(poses[-1] @ inverse(a) @ b @ drift)
    return poses


def closure(a: int, b: int, off: float = 0.0) -> dict[str, Any]:
    T = inverse(TRUE[a]) @ TRUE[b]
    T[0, 3] += off
    return {
        "from_ns": a * STEP_NS,
        "to_ns": b * STEP_NS,
        "T_from_to": T.tolist(),
        "covariance": np.diag([0.02**2] * 3 + [0.01**2] * 3).tolist(),
        "labels": ["cup", "book"],
    }


def refusal(reason: str, a: int, b: int) -> dict[str, Any]:
    return {"reason": reason, "from_ns": a * STEP_NS, "to_ns": b * STEP_NS, "detail": f"0.3 < 0.5 & {reason}"}


def glimpse(k: int, T_odom_camera: np.ndarray) -> dict[str, Any]:
    seen = [(label, transform(inverse(TRUE[k]), np.array(xyz))) for label, xyz in OBJECTS]
    near = [(label, xyz) for label, xyz in seen if np.linalg.norm(xyz) < 1.0]
    return {
        "stamp_ns": k * STEP_NS,
        "T_odom_camera": T_odom_camera.tolist(),
        "labels": [label for label, _ in near],
        "objects": [[label, xyz.tolist()] for label, xyz in near],
    }


def summary(false: bool = False) -> dict[str, Any]:
    closures = [closure(k, k + COUNT // 2) for k in (5, 20, 40, 55)]
    refusals = [("no_candidate", 0, 3), ("texture_disagrees", 3, 70), ("texture_disagrees", 9, 99)]
    return {
        "frames": COUNT,
        "detections": 90,
        "objects": 80,
        "constraints": [*closures, *([closure(10, 90, off=0.5)] if false else [])],
        "rejected": {"texture_disagrees": 2, "no_candidate": 1},
        "refusals": [refusal(*row) for row in refusals],
        "glimpses": [glimpse(k, T) for k, T in enumerate(odometry())],
        "stage_ms": {"detect": {"p50": 8.0, "p95": 11.0}, "register": {"p50": 0.2, "p95": 90.0}},
    }


def tracked(begins: int = 0) -> dict[str, Any]:
    """The walk without odometry: our own tracking has it, lost at frame ``begins`` and begun anew there, if not 0."""
    run = summary()
    poses = odometry()
    for k, row in enumerate(run["glimpses"]):
        first = begins if k >= begins else 0
        T = inverse(poses[first]) @ poses[k]
        row |= {"T_odom_camera": None, "tracked": {"session": int(k >= begins > 0), "T_session_camera": T.tolist()}}
    return {**run, "odometry": "tracked"}


def with_a_stray(stamp_ns: int) -> dict[str, Any]:
    """The walk with a frame of another time before it, whose label nothing else has, and with a refusal of then."""
    run = summary()
    stray = {**run["glimpses"][0], "stamp_ns": stamp_ns, "labels": ["ghost"]}
    refused = {**refusal("low_overlap", 0, 0), "from_ns": stamp_ns, "to_ns": stamp_ns}
    return {**run, "glimpses": [stray, *run["glimpses"]], "refusals": [*run["refusals"], refused]}
