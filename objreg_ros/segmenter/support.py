# SPDX-License-Identifier: Apache-2.0
"""The surfaces that things stand on: every level plane of the frame, of whatever height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data import Array, Intrinsics
from objreg_ros.segmenter.components import connect
from objreg_ros.segmenter.surface import Surface

MAX_SUPPORTS = 6
BIN = 0.015  # metres of height
TILT = np.cos(np.radians(20.0))  # a cell of a level surface is no farther from up than this
PLANE_TILT = np.cos(np.radians(8.0))


@dataclass(frozen=True, slots=True)
class Plane:
    """Points p with ``normal · p + offset = 0``; ``normal (3,)`` points up, so the left side is the height above it."""

    normal: Array
    offset: float

    def height(self, points: Array) -> Array:
        """Metres of points (..., 3) above the plane."""
        return points @ self.normal.astype(points.dtype) + np.float32(self.offset)


@dataclass(frozen=True, slots=True)
class Support:
    """One level plane: ``parts (h, w) int32`` numbers its connected parts from 1 on the grid it was found on, 0 is
    elsewhere; ``area`` in m²."""

    plane: Plane
    parts: Array
    area: float

    def parts_within(self, window: tuple[slice, slice], share: float) -> Array:
        """(h, w) bool: the parts of which more than ``share`` lies in ``window`` of the grid (tops of an object)."""
        total = np.bincount(self.parts.ravel())
        within = np.bincount(self.parts[window].ravel(), minlength=len(total))
        inner = within > share * total
        inner[0] = False
        return inner[self.parts]


@dataclass(frozen=True, slots=True)
class Ground:
    """What the whole frame tells: the way up (3,) or None, its confidence, the support surfaces and their grid."""

    up: Array | None
    confidence: float
    supports: list[Support]
    surface: Surface


def tolerance(depth: Array) -> Array:
    """Metres that a point of a plane may lie off it: structured-light noise grows with squared depth (Khoshelham and
    Elberink, "Accuracy and resolution of Kinect depth data", 2012)."""
    return np.float32(0.008) + np.float32(0.006) * depth * depth


def find_supports(
    surface: Surface, camera: Intrinsics, up: Array, min_area: float, jump: tuple[float, float]
) -> list[Support]:
    """The level surfaces of a frame, largest first; ``up (3,)`` in the camera frame, ``jump`` as in `connect`.

    Heights along ``up`` vote in bins with the area that each cell covers; each peak is fitted by least squares.
    """
    points = surface.points
    cosine = surface.normals @ up.astype(np.float32)
    free = cosine > TILT
    height = points @ up.astype(np.float32)
    area = surface.areas(camera)
    supports: list[Support] = []
    for _ in range(MAX_SUPPORTS):
        found = _largest(surface, points, height, area, free, up, jump)
        if found is None or found.area < min_area:
            break
        supports.append(found)
        free = free & (np.abs(found.plane.height(points)) > 1.5 * tolerance(surface.depth))
    return supports


def _largest(
    surface: Surface, points: Array, height: Array, area: Array, free: Array, up: Array, jump: tuple[float, float]
) -> Support | None:
    depth = surface.depth
    if np.count_nonzero(free) < 30:
        return None
    h = height[free]
    low = float(h.min())
    votes = np.convolve(np.bincount(((h - low) / BIN).astype(int), weights=area[free]), (0.5, 1.0, 0.5), "same")
    peak = low + (int(votes.argmax()) + 0.5) * BIN
    plane = Plane(up, -peak)
    for scale in (2.0, 1.0, 1.0):
        cells = free & (np.abs(plane.height(points)) < scale * tolerance(depth))
        fitted = fit_plane(points[cells], up)
        if fitted is None:
            break
        plane = fitted
    cells = free & (np.abs(plane.height(points)) < tolerance(depth))
    return Support(plane, connect(surface.depth, cells, jump)[0], float(area[cells].sum()))


def fit_plane(points: Array, up: Array) -> Plane | None:
    """The least-squares plane of points (N, 3), if it is level to 8°; None otherwise or for fewer than 12 points."""
    if len(points) < 12:
        return None
    centre = points.mean(axis=0, dtype=np.float64)
    offsets = points.astype(np.float64) - centre
    normal = np.linalg.eigh(offsets.T @ offsets)[1][:, 0]
    normal = normal if normal @ up > 0 else -normal
    return Plane(normal, float(-normal @ centre)) if normal @ up > PLANE_TILT else None
