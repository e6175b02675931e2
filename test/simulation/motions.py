# SPDX-License-Identifier: Apache-2.0
"""Motions: turns about a point, how far they take a shape from itself, and how fast a camera is carried."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from objreg_ros.geometry import pose, rotation_angle, transform
from objreg_tools.simulation.world.mesh import Mesh
from objreg_tools.simulation.world.model import turn


def about(axis: str, degrees: float, centre: np.ndarray) -> np.ndarray:
    """The turn (4, 4) about x, y or z through ``centre``."""
    shift = pose(np.eye(3), centre)
    return shift @ turn(axis, degrees) @ np.linalg.inv(shift)


def gap(mesh: Mesh, motion: np.ndarray) -> float:
    """The distance in metres within which 97 % of the surface lies after the motion of where it was before."""
    corners = mesh.vertices[mesh.faces].astype(float)
    points = corners.mean(axis=1)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    moved = transform(motion, points)
    distance = np.linalg.norm(moved[:, None] - points[None], axis=2).min(axis=1)
    order = np.argsort(distance)
    return float(distance[order][np.searchsorted(np.cumsum(area[order]), 0.97 * area.sum())])


def speeds(poses: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Speed in m/s and turning in deg/s between consecutive poses (N, 4, 4) at ``rate`` Hz."""
    moved = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) * rate
    turned = [rotation_angle(a[:3, :3].T @ b[:3, :3]) for a, b in pairwise(poses)]
    return moved, np.degrees(turned) * rate
