# SPDX-License-Identifier: Apache-2.0
"""The surfaces that things stand on: every level plane of the frame, of whatever height."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array, Intrinsics
from objreg_ros.segmenter.components import connect
from objreg_ros.segmenter.surface import EXACT, Surface

MAX_SUPPORTS = 6
BIN = 0.015  # metres of height
TILT = float(np.cos(np.radians(20.0)))  # a cell of a level surface is no farther from up than this
SLOPE = float(np.tan(np.radians(8.0)))  # nor is a level plane steeper
MIN_CELLS = 30
LAYER, LAYERS = 0.3, 5  # thickness in tolerances, and number to each side, of the layers sought around a plane
CLIPS = np.array([1.0, 1.5, 1.5, 2.5, 3.0, 3.0], np.float32)  # the first of the tolerance, the others of the spread


@dataclass(frozen=True, slots=True)
class Plane:
    """Points p with ``normal · p + offset = 0``; ``normal (3,)`` points up, so the left side is the height above it.

    ``spread`` is the standard deviation of its points in units of `tolerance`.
    """

    normal: Array
    offset: float
    spread: float

    def height(self, points: Array) -> Array:
        """Metres of points (..., 3) above the plane."""
        return points @ self.normal.astype(points.dtype) + np.float32(self.offset)


@dataclass(frozen=True, slots=True)
class Support:
    """One level plane: ``parts (h, w) int32`` numbers its connected parts from 1 on the grid it was found on, 0 is
    elsewhere; ``total`` counts the cells of each number; ``area`` in m²."""

    plane: Plane
    parts: Array
    total: Array
    area: float


@dataclass(frozen=True, slots=True)
class Ground:
    """What the whole frame tells: the way up (3,) or None, its confidence, the support surfaces.

    ``surface`` is the whole frame in cells, ``coarse`` the grid of the supports, every other cell of it."""

    up: Array | None
    confidence: float
    supports: list[Support]
    surface: Surface
    coarse: Surface


def tolerance(depth: Array) -> Array:
    """Metres that a point of a plane may lie off it: structured-light noise grows with squared depth (Khoshelham and
    Elberink, "Accuracy and resolution of Kinect depth data", 2012)."""
    return np.float32(FLOOR) + np.float32(GROWTH) * depth * depth


FLOOR, GROWTH = 0.008, 0.006


def find_supports(
    surface: Surface, camera: Intrinsics, up: Array, min_area: float, jump: tuple[float, float]
) -> list[Support]:
    """The level surfaces of a frame, largest first; ``up (3,)`` in the camera frame, ``jump`` as in `connect`.

    Heights along ``up`` vote in bins with the area that each cell covers; each peak is fitted by least squares.
    """
    height, cosine = _heights(surface, Plane(up, 0.0, 1.0))
    free = cosine > TILT
    area = surface.areas(camera)
    unit = tolerance(surface.depth)
    supports: list[Support] = []
    while len(supports) < MAX_SUPPORTS and np.count_nonzero(free) >= MIN_CELLS:
        peak = _commonest(height[free], area[free])
        plane = fit_level(surface, free, up, Plane(up, -peak, 1.0))
        if plane is None:
            free &= np.abs(height - peak) > 2 * BIN
            continue
        off = np.abs(_heights(surface, plane)[0])
        cells = free & (off < unit)
        size = float(area[cells].sum())
        if size < min_area:
            break
        parts, _ = connect(surface.depth, cells, jump)
        supports.append(Support(plane, parts, np.bincount(parts.ravel()), size))
        free &= off > 1.5 * unit
    return supports


def _heights(surface: Surface, plane: Plane) -> tuple[Array, Array]:
    """(h, w) float32 height of each cell above ``plane``, and the cosine of its normal to the plane's; 0 if unknown."""
    height, cosine = np.empty_like(surface.depth), np.empty_like(surface.depth)
    normal = plane.normal.astype(np.float32)
    _raise(surface.depth, surface.normals, surface.x, surface.y, normal, np.float32(plane.offset), height, cosine)
    return height, cosine


@numba.njit(cache=True, fastmath=EXACT)
def _raise(depth, normals, x, y, n, offset, height, cosine):  # type: ignore[no-untyped-def]
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            height[i, j] = depth[i, j] * (n[0] * x[j] + n[1] * y[i] + n[2]) + offset
            cosine[i, j] = n[0] * normals[0, i, j] + n[1] * normals[1, i, j] + n[2] * normals[2, i, j]


def _commonest(height: Array, area: Array) -> float:
    """The height (N,) that most area (N,) has."""
    low = float(height.min())
    votes = np.convolve(np.bincount(((height - low) / BIN).astype(int), weights=area), (0.5, 1.0, 0.5), "same")
    return low + (int(votes.argmax()) + 0.5) * BIN


def fit_level(
    surface: Surface, cells: Array, up: Array, plane: Plane, stride: int = 1, lowest: bool = False
) -> Plane | None:
    """The plane of the level ones among ``cells (h, w) bool`` near ``plane``; None for fewer than 30 or a steep plane.

    Weighted least squares of the height along ``up`` over the plane, with shrinking, then growing, limits: so the
    larger of two surfaces with a small step between them wins, or the ``lowest`` of similar ones.
    """
    side = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(up, side), up])
    n_side, n_other, n_up = frame @ plane.normal
    start = np.array([-plane.offset / n_up, -n_side / n_up, -n_other / n_up])
    levels = np.empty(4)
    grid = (surface.depth, surface.normals, surface.x, surface.y)
    count = _fit_level(*grid, cells, frame.astype(np.float32), start, stride, lowest, CLIPS, levels)
    if count < MIN_CELLS or np.hypot(levels[1], levels[2]) > SLOPE:
        return None
    normal = up - levels[1] * frame[0] - levels[2] * frame[1]
    length = float(np.linalg.norm(normal))
    return Plane(normal / length, float(-levels[0] / length), float(levels[3]))


@numba.njit(cache=True, fastmath=EXACT)
def _lowest_layer(depth, normals, x, y, cells, frame, start, stride):  # type: ignore[no-untyped-def]
    """The height over the plane of the lowest layer of many level cells, in units of the tolerance."""
    votes = np.zeros(2 * LAYERS + 3)
    for i in range(0, depth.shape[0], stride):
        for j in range(0, depth.shape[1], stride):
            n = normals[0, i, j] * frame[2, 0] + normals[1, i, j] * frame[2, 1] + normals[2, i, j] * frame[2, 2]
            if cells[i, j] and n > TILT:
                z = depth[i, j]
                px, py = x[j] * z, y[i] * z
                s = frame[0, 0] * px + frame[0, 1] * py + frame[0, 2] * z
                t = frame[1, 0] * px + frame[1, 1] * py + frame[1, 2] * z
                r = frame[2, 0] * px + frame[2, 1] * py + frame[2, 2] * z - (start[0] + start[1] * s + start[2] * t)
                k = int(np.floor(r / (FLOOR + GROWTH * z * z) / LAYER + LAYERS + 1.5))
                if k >= 0 and k < len(votes):
                    votes[k] += 1
    for k in range(1, len(votes) - 1):
        if votes[k] >= votes.max() / 2 and votes[k] >= votes[k + 1]:
            return (k - LAYERS - 1) * LAYER
    return 0.0


@numba.njit(cache=True, fastmath=EXACT)
def _fit_level(depth, normals, x, y, cells, frame, start, stride, lowest, clips, levels):  # type: ignore[no-untyped-def]
    """Fill ``levels`` with c, a, b of height = c + a s + b t and the spread; the number of cells of the last fit."""
    h, w = depth.shape
    c, a, b, spread = start[0], start[1], start[2], 1.0
    count = 0
    shift = _lowest_layer(depth, normals, x, y, cells, frame, start, stride) if lowest else 0.0
    for clip in clips:
        limit = clip * spread
        if lowest and clip == clips[0]:
            limit = LAYER
        M, v = np.zeros((3, 3)), np.zeros(3)
        square, weight, count = 0.0, 0.0, 0
        for i in range(0, h, stride):
            for j in range(0, w, stride):
                cosine = (
                    normals[0, i, j] * frame[2, 0] + normals[1, i, j] * frame[2, 1] + normals[2, i, j] * frame[2, 2]
                )
                if not cells[i, j] or cosine < TILT:
                    continue
                z = depth[i, j]
                px, py = x[j] * z, y[i] * z
                s = frame[0, 0] * px + frame[0, 1] * py + frame[0, 2] * z
                t = frame[1, 0] * px + frame[1, 1] * py + frame[1, 2] * z
                r = frame[2, 0] * px + frame[2, 1] * py + frame[2, 2] * z - (c + a * s + b * t)
                unit = FLOOR + GROWTH * z * z
                if abs(r - shift * unit) > limit * unit:
                    continue
                g = 1 / (unit * unit)
                count += 1
                weight += g
                square += g * r * r
                M[0, 0] += g
                M[0, 1] += g * s
                M[0, 2] += g * t
                M[1, 1] += g * s * s
                M[1, 2] += g * s * t
                M[2, 2] += g * t * t
                v[0] += g * r
                v[1] += g * s * r
                v[2] += g * t * r
        if count < MIN_CELLS:
            return 0
        M[1, 0], M[2, 0], M[2, 1] = M[0, 1], M[0, 2], M[1, 2]
        for k in range(3):
            M[k, k] += 1e-6 * M[0, 0]
        step = np.linalg.solve(M, v)
        c, a, b = c + step[0], a + step[1], b + step[2]
        spread = max(np.sqrt(square / count), 0.02)
        shift = 0.0
    levels[0], levels[1], levels[2], levels[3] = c, a, b, spread
    return count
