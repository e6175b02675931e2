# SPDX-License-Identifier: Apache-2.0
"""The surfaces that things stand on: every level plane of the frame, of whatever height."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data import Array, Intrinsics
from objreg_ros.segmenter.components import connect
from objreg_ros.segmenter.surface import EXACT, MIN_COSINE, Surface

MAX_SUPPORTS = 6
BIN = 0.015  # metres of height
TILT = np.float32(np.cos(np.radians(20.0)))  # a cell of a level surface is no farther from up than this
SLOPE = float(np.tan(np.radians(8.0)))  # nor is a level plane steeper
MIN_CELLS = 30
MANY = 6000  # level cells of which every fourth is enough
NEAR = np.float32(2.5)  # tolerances around a plane within which its cells are sought
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


FLOOR, GROWTH = np.float32(0.008), np.float32(0.006)


def tolerance(depth: Array) -> Array:
    """Metres that a point of a plane may lie off it: structured-light noise grows with squared depth (Khoshelham and
    Elberink, "Accuracy and resolution of Kinect depth data", 2012)."""
    return FLOOR + GROWTH * depth * depth


def find_supports(
    surface: Surface, camera: Intrinsics, up: Array, min_area: float, jump: tuple[float, float]
) -> list[Support]:
    """The level surfaces of a frame, largest first; ``up (3,)`` in the camera frame, ``jump`` as in `connect`.

    Heights along ``up`` vote in bins with the area that each cell covers; each peak is fitted by least squares.
    """
    height, area = np.empty_like(surface.depth), np.empty_like(surface.depth)
    grid = (surface.depth, surface.normals, surface.x, surface.y)
    pixel = np.float32(surface.step**2 / (camera.fx * camera.fy))
    low, high = _survey(*grid, up.astype(np.float32), pixel, height, area)
    supports: list[Support] = []
    for _ in range(2 * MAX_SUPPORTS):
        free = area > 0
        peak = _commonest(height, area, low, high)
        if peak is None or len(supports) == MAX_SUPPORTS:
            break
        stride = 2 if np.count_nonzero(free) > MANY else 1
        plane = fit_level(surface, free, up, Plane(up, -peak, 1.0), stride)
        cells = np.zeros(free.shape, np.bool_)
        if plane is None:
            area[np.abs(height - np.float32(peak)) < 2 * BIN] = 0
            continue
        size = _claim(surface.depth, surface.x, surface.y, plane.normal.astype(np.float32), plane.offset, area, cells)
        if size < min_area:
            break
        parts, _ = connect(surface.depth, cells, jump)
        supports.append(Support(plane, parts, np.bincount(parts.ravel()), size))
    return supports


@numba.njit(cache=True, fastmath=EXACT, error_model="numpy")
def _survey(depth, normals, x, y, up, pixel, height, area):  # type: ignore[no-untyped-def]
    """Fill the height along up and the m² of each level cell, 0 for the others; the lowest and the highest one."""
    low, high = np.float32(np.inf), np.float32(-np.inf)
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            n_x, n_y, n_z = normals[0, i, j], normals[1, i, j], normals[2, i, j]
            level = n_x * up[0] + n_y * up[1] + n_z * up[2] > TILT
            flat = max(abs(n_x * x[j] + n_y * y[i] + n_z), MIN_COSINE)
            h = z * (up[0] * x[j] + up[1] * y[i] + up[2])
            height[i, j] = h
            area[i, j] = z * z * pixel / flat if level else np.float32(0)
            low = min(low, h) if level else low
            high = max(high, h) if level else high
    return low, high


def _commonest(height: Array, area: Array, low: float, high: float) -> float | None:
    """The height in ``low`` … ``high`` that most ``area`` has; None for none."""
    if not low <= high:
        return None
    votes = np.zeros(int((high - low) / BIN) + 3)
    _vote(height, area, np.float32(low), np.float32(BIN), votes)
    votes[1:-1] += 0.5 * (votes[2:] + votes[:-2])
    best = int(votes.argmax())
    return low + (best - 0.5) * BIN if votes[best] > 0 else None


@numba.njit(cache=True)
def _vote(height, area, low, width, votes):  # type: ignore[no-untyped-def]
    for i in range(height.shape[0]):
        for j in range(height.shape[1]):
            if area[i, j] > 0:
                votes[int((height[i, j] - low) / width) + 1] += area[i, j]


@numba.njit(cache=True, fastmath=EXACT)
def _claim(depth, x, y, n, offset, area, cells):  # type: ignore[no-untyped-def]
    """Mark the cells of a plane and take them, and those just off it, out of ``area``; the m² of the plane."""
    total = 0.0
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            off = abs(z * (n[0] * x[j] + n[1] * y[i] + n[2]) + np.float32(offset))
            unit = FLOOR + GROWTH * z * z
            if area[i, j] > 0 and off < np.float32(1.5) * unit:
                if off < unit:
                    cells[i, j] = True
                    total += area[i, j]
                area[i, j] = 0
    return total


def fit_level(
    surface: Surface, cells: Array, up: Array, plane: Plane, stride: int = 1, lowest: bool = False
) -> Plane | None:
    """The plane of the level ones among ``cells (h, w) bool`` near ``plane``; None for fewer than 30 or a steep plane.

    Weighted least squares of the height along ``up`` over the plane, with shrinking, then growing, limits: so the
    larger of two surfaces with a small step between them wins, or the ``lowest`` of similar ones.
    """
    side = np.array([up[1], -up[0], 0.0]) if abs(up[2]) < 0.9 else np.array([0.0, up[2], -up[1]])
    side /= np.sqrt(side @ side)
    frame = np.stack([side, _cross(up, side), up])
    n_side, n_other, n_up = frame @ plane.normal
    start = np.array([-plane.offset / n_up, -n_side / n_up, -n_other / n_up], np.float32)
    samples = np.empty((4, -(-cells.shape[0] // stride) * -(-cells.shape[1] // stride)), np.float32)
    grid = (surface.depth, surface.normals, surface.x, surface.y)
    count = _sample(*grid, cells, frame.astype(np.float32), start, stride, samples)
    levels = np.empty(4)
    if count < MIN_CELLS or not _fit(samples[:, :count], lowest, CLIPS, levels):
        return None
    if np.hypot(levels[1], levels[2]) > SLOPE:
        return None
    levels[:3] += start
    normal = up - levels[1] * frame[0] - levels[2] * frame[1]
    length = float(np.sqrt(normal @ normal))
    return Plane(normal / length, float(-levels[0] / length), float(levels[3]))


def _cross(a: Array, b: Array) -> Array:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@numba.njit(cache=True, fastmath=EXACT)
def _sample(depth, normals, x, y, cells, frame, start, stride, samples):  # type: ignore[no-untyped-def]
    """Fill ``samples`` with s, t in the plane, height over ``start`` and tolerance, of the level cells near it."""
    n = 0
    up = frame[2]
    for i in range(0, depth.shape[0], stride):
        for j in range(0, depth.shape[1], stride):
            cosine = normals[0, i, j] * up[0] + normals[1, i, j] * up[1] + normals[2, i, j] * up[2]
            if not cells[i, j] or cosine < TILT:
                continue
            z = depth[i, j]
            p_x, p_y = x[j] * z, y[i] * z
            s = frame[0, 0] * p_x + frame[0, 1] * p_y + frame[0, 2] * z
            t = frame[1, 0] * p_x + frame[1, 1] * p_y + frame[1, 2] * z
            r = up[0] * p_x + up[1] * p_y + up[2] * z - (start[0] + start[1] * s + start[2] * t)
            unit = FLOOR + GROWTH * z * z
            if abs(r) < NEAR * unit:
                samples[0, n], samples[1, n], samples[2, n], samples[3, n] = s, t, r, unit
                n += 1
    return n


@numba.njit(cache=True, fastmath=EXACT)
def _lowest_layer(samples):  # type: ignore[no-untyped-def]
    """The height of the lowest layer of many samples, in units of the tolerance."""
    votes = np.zeros(2 * LAYERS + 3)
    for n in range(samples.shape[1]):
        k = int(np.floor(samples[2, n] / samples[3, n] / LAYER + LAYERS + 1.5))
        if k >= 0 and k < len(votes):
            votes[k] += 1
    for k in range(1, len(votes) - 1):
        if votes[k] >= votes.max() / 2 and votes[k] >= votes[k + 1]:
            return (k - LAYERS - 1) * LAYER
    return 0.0


@numba.njit(cache=True, fastmath=EXACT)
def _fit(samples, lowest, clips, levels):  # type: ignore[no-untyped-def]
    """Fill ``levels`` with c, a, b of height = c + a s + b t and the spread; whether enough samples agree."""
    zero = np.float32(0)
    c, a, b = zero, zero, zero
    shift = np.float32(_lowest_layer(samples)) if lowest else zero
    limit = np.float32(LAYER) if lowest else clips[0]
    for k in range(len(clips)):
        m, m_s, m_t, m_ss, m_st, m_tt, v, v_s, v_t, square, count = (
            zero,
            zero,
            zero,
            zero,
            zero,
            zero,
            zero,
            zero,
            zero,
            zero,
            zero,
        )
        for n in range(samples.shape[1]):
            s, t, unit = samples[0, n], samples[1, n], samples[3, n]
            r = samples[2, n] - c - a * s - b * t
            inside = abs(r - shift * unit) < limit * unit
            g = np.float32(1) / (unit * unit) if inside else zero
            count += np.float32(1) if inside else zero
            square += g * r * r
            m, m_s, m_t = m + g, m_s + g * s, m_t + g * t
            m_ss, m_st, m_tt = m_ss + g * s * s, m_st + g * s * t, m_tt + g * t * t
            v, v_s, v_t = v + g * r, v_s + g * s * r, v_t + g * t * r
        if count < MIN_CELLS:
            return False
        M = np.array([[m, m_s, m_t], [m_s, m_ss, m_st], [m_t, m_st, m_tt]], np.float64)
        for d in range(3):
            M[d, d] += 1e-6 * m
        step = np.linalg.solve(M, np.array([v, v_s, v_t], np.float64))
        c, a, b = c + np.float32(step[0]), a + np.float32(step[1]), b + np.float32(step[2])
        spread = max(np.sqrt(square / count), np.float32(0.02))
        shift = zero
        if k + 1 < len(clips):
            limit = clips[k + 1] * spread
    levels[0], levels[1], levels[2], levels[3] = c, a, b, spread
    return True
