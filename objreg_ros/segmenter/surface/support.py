# SPDX-License-Identifier: Apache-2.0
"""The surfaces that objects stand on: every level plane of the frame, of whatever height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.native import kernels
from objreg_ros.segmenter.surface.cells import Surface
from objreg_ros.segmenter.surface.components import connect
from objreg_ros.sensor import PLANE_TOLERANCE_GROWTH, PLANE_TOLERANCE_M

_KERNELS = kernels("support")
TOLERANCE = (PLANE_TOLERANCE_M, PLANE_TOLERANCE_GROWTH)  # of a plane: m, and its growth with z², 1/m
COARSE = 2  # every so many cells of a frame are used for gravity and the supports
MAX_SUPPORTS = 6
BIN = 0.015  # metres of height
MIN_CELLS = 30  # of a plane
LEAST_PEAK = 0.25  # of the least area: a lower peak of the heights has no surface of that area
MANY = 3000  # level cells of which every fourth is enough


@dataclass(frozen=True, slots=True)
class Plane:
    """Points p with ``normal · p + offset = 0``; ``normal (3,)`` points up, so the left side is the height above it.

    ``spread`` is the standard deviation of its points in tolerances of a plane (`sensor`) at their depths.
    """

    normal: Array
    offset: float
    spread: float


@dataclass(frozen=True, slots=True)
class SupportPlane:
    """One level plane: ``parts (h, w) int32`` numbers its connected parts from 1 on the grid it was found on, 0 is
    elsewhere; ``total`` counts the cells of each number; ``area`` in m²."""

    plane: Plane
    parts: Array
    total: Array
    area: float


@dataclass(frozen=True, slots=True)
class Ground:
    """What the whole frame gives: the direction up (3,) or None, its confidence, the support surfaces.

    ``surface`` is the whole frame in cells, ``coarse`` every `COARSE`-th cell of it, the grid of the supports."""

    up: Array | None
    confidence: float
    supports: list[SupportPlane]
    surface: Surface
    coarse: Surface


def find_supports(
    surface: Surface, camera: Intrinsics, up: Array | None, min_area: float, jump: tuple[float, float]
) -> list[SupportPlane]:
    """The level surfaces of a frame, largest first; ``up (3,)`` in the camera frame, ``jump`` as in `connect`.

    Heights along ``up`` vote in bins with the area that each cell covers; each peak is fitted by least squares.
    None where up is not known.
    """
    if up is None:
        return []
    height, area = np.empty_like(surface.depth), np.empty_like(surface.depth)
    grid = (surface.depth, surface.normals, surface.x, surface.y)
    pixel = np.float32(surface.step**2 / (camera.fx * camera.fy))
    low, high = _KERNELS.survey(grid, up.astype(np.float32), pixel, height, area)
    supports: list[SupportPlane] = []
    for _ in range(2 * MAX_SUPPORTS):
        peak, votes, count = _KERNELS.commonest(height, area, low, high, BIN)
        if votes < LEAST_PEAK * min_area or count < MIN_CELLS or len(supports) == MAX_SUPPORTS:
            break
        plane = fit_level(surface, area > 0, up, Plane(up, -peak, 1.0), 2 if count > MANY else 1)
        if plane is None:
            area[np.abs(height - np.float32(peak)) < 2 * BIN] = 0
            continue
        cells = np.zeros(area.shape, np.bool_)
        equation = (plane.normal.astype(np.float32), plane.offset, TOLERANCE)
        size = _KERNELS.claim(surface.depth, surface.x, surface.y, *equation, area, cells)
        if size < min_area:
            break
        parts, _ = connect(surface.depth, cells, jump)
        supports.append(SupportPlane(plane, parts, np.bincount(parts.ravel()), size))
    return supports


def fit_level(
    surface: Surface, cells: Array, up: Array, plane: Plane, stride: int = 1, lowest: bool = False
) -> Plane | None:
    """The plane of the level ones among ``cells (h, w) bool`` near ``plane``; None for fewer than 30 or a steep plane.

    Weighted least squares of the height along ``up`` over the plane, with shrinking, then growing, limits: so the
    larger of two surfaces with a small step between them wins, or the ``lowest`` of similar ones.
    """
    grid = (surface.depth, surface.normals, surface.x, surface.y)
    found, normal, offset, spread = _KERNELS.fit_level(
        grid, cells, up, plane.normal, plane.offset, TOLERANCE, MIN_CELLS, stride, lowest
    )
    return Plane(normal, offset, spread) if found else None
