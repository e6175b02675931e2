# SPDX-License-Identifier: Apache-2.0
"""The surfaces that objects stand on: every level plane of the frame, of whatever height."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.segmenter.surface.cells import EXACT, MIN_COSINE, Surface
from objreg_ros.segmenter.surface.components import connect
from objreg_ros.sensor import PLANE_TOLERANCE_GROWTH, PLANE_TOLERANCE_M

COARSE = 2  # every so many cells of a frame are used for gravity and the supports
MAX_SUPPORTS = 6
BIN = 0.015  # metres of height
TILT = np.float32(np.cos(np.radians(20.0)))  # a cell of a level surface is no farther from up than this
SLOPE = float(np.tan(np.radians(8.0)))  # nor is a level plane steeper
MIN_CELLS = 30
LEAST_PEAK = 0.25  # of the least area: a lower peak of the heights has no surface of that area
MANY = 3000  # level cells of which every fourth is enough
NEAR = np.float32(2.5)  # tolerances around a plane within which its cells are sought
LAYER, LAYERS = 0.3, 5  # thickness in tolerances, and number to each side, of the layers sought around a plane
CLIPS = (1.0, 1.5, 1.5, 2.5, 3.0, 3.0)  # the first of the tolerance, the others of the spread


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
    low, high = _survey(*grid, up.astype(np.float32), pixel, height, area)
    supports: list[SupportPlane] = []
    for _ in range(2 * MAX_SUPPORTS):
        peak, votes, count = _commonest(height, area, low, high)
        if votes < LEAST_PEAK * min_area or count < MIN_CELLS or len(supports) == MAX_SUPPORTS:
            break
        plane = fit_level(surface, area > 0, up, Plane(up, -peak, 1.0), 2 if count > MANY else 1)
        if plane is None:
            area[np.abs(height - np.float32(peak)) < 2 * BIN] = 0
            continue
        cells = np.zeros(area.shape, np.bool_)
        size = _claim(surface.depth, surface.x, surface.y, plane.normal.astype(np.float32), plane.offset, area, cells)
        if size < min_area:
            break
        parts, _ = connect(surface.depth, cells, jump)
        supports.append(SupportPlane(plane, parts, np.bincount(parts.ravel()), size))
    return supports


@numba.njit(cache=True, nogil=True, fastmath=EXACT, error_model="numpy")
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


@numba.njit(cache=True, nogil=True)
def _commonest(height, area, low, high):  # type: ignore[no-untyped-def]
    """The height in ``low`` … ``high`` that most ``area`` has, how much it is, and how many cells have any."""
    if not low <= high:
        return 0.0, 0.0, 0
    votes = np.zeros(int((high - low) / BIN) + 3)
    count = 0
    for i in range(height.shape[0]):
        for j in range(height.shape[1]):
            if area[i, j] > 0:
                votes[int((height[i, j] - low) / BIN) + 1] += area[i, j]
                count += 1
    best, most = 1, 0.0
    for k in range(1, len(votes) - 1):
        smooth = votes[k] + 0.5 * (votes[k - 1] + votes[k + 1])
        if smooth > most:
            best, most = k, smooth
    return low + (best - 0.5) * BIN, most, count


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _claim(depth, x, y, n, offset, area, cells):  # type: ignore[no-untyped-def]
    """Mark the cells of a plane and take them, and those just off it, out of ``area``; the m² of the plane."""
    total = 0.0
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            off = abs(z * (n[0] * x[j] + n[1] * y[i] + n[2]) + np.float32(offset))
            unit = PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH * z * z
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
    grid = (surface.depth, surface.normals, surface.x, surface.y)
    found, normal, offset, spread = _fit_level(grid, cells, up, plane.normal, plane.offset, stride, lowest)
    return Plane(normal, offset, spread) if found else None


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fit_level(grid, cells, up, normal, offset, stride, lowest):  # type: ignore[no-untyped-def]
    """Whether there is a plane; its normal, offset and spread."""
    frame, start, levels = np.zeros((3, 3)), np.empty(3, np.float32), np.zeros(4)
    _fill_level_frame(up, frame)
    n_side, n_other, n_up = _dot(frame[0], normal), _dot(frame[1], normal), _dot(frame[2], normal)
    start[0], start[1], start[2] = -offset / n_up, -n_side / n_up, -n_other / n_up
    samples = np.empty((4, -(-cells.shape[0] // stride) * -(-cells.shape[1] // stride)), np.float32)
    count = _sample(grid, cells, frame, start, stride, samples)
    if count < MIN_CELLS or not _fit(samples[:, :count], lowest, levels):
        return False, normal, offset, 0.0
    if np.hypot(levels[1], levels[2]) > SLOPE:
        return False, normal, offset, 0.0
    side, other = levels[1] + start[1], levels[2] + start[2]
    tilted = np.empty(3)
    for k in range(3):
        tilted[k] = up[k] - side * frame[0, k] - other * frame[1, k]
    length = np.sqrt(_dot(tilted, tilted))
    for k in range(3):
        tilted[k] /= length
    return True, tilted, -(levels[0] + start[0]) / length, levels[3]


@numba.njit(cache=True, nogil=True)
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fill_level_frame(up, frame):  # type: ignore[no-untyped-def]
    """Fill ``frame (3, 3)`` with two level axes and ``up``, as rows."""
    if abs(up[2]) < 0.9:
        frame[0, 0], frame[0, 1] = up[1], -up[0]
    else:
        frame[0, 1], frame[0, 2] = up[2], -up[1]
    length = np.sqrt(_dot(frame[0], frame[0]))
    for k in range(3):
        frame[0, k] /= length
        frame[2, k] = up[k]
    for k in range(3):
        p, q = (k + 1) % 3, (k + 2) % 3
        frame[1, k] = up[p] * frame[0, q] - up[q] * frame[0, p]


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _sample(grid, cells, frame, start, stride, samples):  # type: ignore[no-untyped-def]
    """Fill ``samples`` with s, t in the plane, height over ``start`` and 1 / tolerance, of the level cells near it."""
    depth, normals, x, y = grid
    a_x, a_y, a_z = np.float32(frame[0, 0]), np.float32(frame[0, 1]), np.float32(frame[0, 2])
    b_x, b_y, b_z = np.float32(frame[1, 0]), np.float32(frame[1, 1]), np.float32(frame[1, 2])
    u_x, u_y, u_z = np.float32(frame[2, 0]), np.float32(frame[2, 1]), np.float32(frame[2, 2])
    n = 0
    for i in range(0, depth.shape[0], stride):
        for j in range(0, depth.shape[1], stride):
            if not cells[i, j]:
                continue
            cosine = normals[0, i, j] * u_x + normals[1, i, j] * u_y + normals[2, i, j] * u_z
            if cosine < TILT:
                continue
            z = depth[i, j]
            p_x, p_y = x[j] * z, y[i] * z
            s = a_x * p_x + a_y * p_y + a_z * z
            t = b_x * p_x + b_y * p_y + b_z * z
            r = u_x * p_x + u_y * p_y + u_z * z - (start[0] + start[1] * s + start[2] * t)
            unit = PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH * z * z
            if abs(r) < NEAR * unit:
                samples[0, n], samples[1, n], samples[2, n], samples[3, n] = s, t, r, np.float32(1) / unit
                n += 1
    return n


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _lowest_layer(samples):  # type: ignore[no-untyped-def]
    """The height of the lowest layer of many samples, in units of the tolerance."""
    votes = np.zeros(2 * LAYERS + 3)
    heights, sharpness = samples[2], samples[3]
    for n in range(len(heights)):
        k = int(heights[n] * sharpness[n] * np.float32(1 / LAYER) + np.float32(LAYERS + 1.5))  # above 0: near a plane
        if 0 <= k < len(votes):
            votes[k] += 1
    most = 0.0
    for k in range(len(votes)):
        most = max(most, votes[k])
    for k in range(1, len(votes) - 1):
        if votes[k] >= most / 2 and votes[k] >= votes[k + 1]:
            return (k - LAYERS - 1) * LAYER
    return 0.0


@numba.njit(cache=True, nogil=True, fastmath=EXACT)
def _fit(samples, lowest, levels):  # type: ignore[no-untyped-def]
    """Fill ``levels`` with c, a, b of height = c + a s + b t and the spread; whether enough samples agree."""
    zero, one = np.float32(0), np.float32(1)
    shift = np.float32(_lowest_layer(samples)) if lowest else zero
    limit = np.float32(LAYER) if lowest else np.float32(CLIPS[0])
    sides, others, heights, sharpness = samples[0], samples[1], samples[2], samples[3]
    for k in range(len(CLIPS)):
        c, a, b = np.float32(levels[0]), np.float32(levels[1]), np.float32(levels[2])
        m, m_s, m_t, m_ss, m_st, m_tt = zero, zero, zero, zero, zero, zero
        v, v_s, v_t, square, count = zero, zero, zero, zero, zero
        for n in range(len(sides)):
            s, t, sharp = sides[n], others[n], sharpness[n]
            r = heights[n] - c - a * s - b * t
            inside = abs(r * sharp - shift) < limit
            g = sharp * sharp if inside else zero
            count += one if inside else zero
            square += g * r * r
            m, m_s, m_t = m + g, m_s + g * s, m_t + g * t
            m_ss, m_st, m_tt = m_ss + g * s * s, m_st + g * s * t, m_tt + g * t * t
            v, v_s, v_t = v + g * r, v_s + g * s * r, v_t + g * t * r
        if count < MIN_CELLS:
            return False
        ridge = 1e-6 * m
        step = solve_symmetric((m + ridge, m_s, m_t, m_ss + ridge, m_st, m_tt + ridge), (v, v_s, v_t))
        levels[0], levels[1], levels[2] = levels[0] + step[0], levels[1] + step[1], levels[2] + step[2]
        levels[3] = max(np.sqrt(square / count), np.float32(0.02))
        shift = zero
        limit = np.float32(CLIPS[min(k + 1, len(CLIPS) - 1)] * levels[3])
    return True


@numba.njit(cache=True, nogil=True, error_model="numpy")
def solve_symmetric(M, v):  # type: ignore[no-untyped-def]
    """The solution of M x = v, with M symmetric, given as its upper triangle row by row: Cramer's rule."""
    a, b, c, d, e, f = (np.float64(M[0]), np.float64(M[1]), np.float64(M[2]), np.float64(M[3]), M[4] * 1.0, M[5] * 1.0)
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * p + b * q + c * r
    return (
        (p * v[0] + q * v[1] + r * v[2]) / determinant,
        (q * v[0] + (a * f - c * c) * v[1] + (b * c - a * e) * v[2]) / determinant,
        (r * v[0] + (b * c - a * e) * v[1] + (a * d - b * b) * v[2]) / determinant,
    )
