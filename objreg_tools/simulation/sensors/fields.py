# SPDX-License-Identifier: Apache-2.0
"""Whole images of smooth random numbers, and where depth has edges: what several depth sensors share.

Nearness is 1/z in 1/m, 0 where nothing is. A plane is linear in it over the image, however slanted.
"""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array

JUMP_SHARE = 0.02
"""Neighbours whose depths differ by more than this share are an edge."""
RAGGED_PX = 3
"""Edges wander together over about as many pixels."""


def smooth(rng: np.random.Generator, shape: tuple[int, int], window: int) -> Array:
    """(H, W) float32: normal numbers of deviation 1, each the mean over a window of white ones, ``window`` px a side.

    Their correlation falls linearly with the distance along a row or a column and is 0 from ``window`` on.
    """
    white = rng.standard_normal((shape[0] + 2 * window, shape[1] + 2 * window), np.float32)
    inner = (slice(window, window + shape[0]), slice(window, window + shape[1]))
    return np.ascontiguousarray(cv2.blur(white, (window, window))[inner] * np.float32(window))


def bends(nearness: Array, reach: int) -> Array:
    """(H, W) by how much nearness bends between the pixels ``reach`` px away, along rows, columns and diagonals."""
    height, width = nearness.shape
    padded = cv2.copyMakeBorder(nearness, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    out = np.zeros_like(nearness)
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        y, x = reach * (1 + dy), reach * (1 + dx)
        after = padded[y : y + height, x : x + width]
        y, x = reach * (1 - dy), reach * (1 - dx)
        before = padded[y : y + height, x : x + width]
        np.maximum(out, np.abs(before + after - 2 * nearness), out=out)
    return out


def edges(nearness: Array, reach: int) -> Array:
    """(H, W) bool: whether a depth edge passes within ``reach`` px."""
    return bends(nearness, reach) > JUMP_SHARE * np.maximum(nearness, 1e-3)


def wandered(nearness: Array, deviation: float, rng: np.random.Generator) -> Array:
    """The nearness with ragged edges: each moves by ``deviation`` px (standard), its neighbours with it."""
    if deviation == 0:
        return nearness
    rows, columns = np.mgrid[0 : nearness.shape[0], 0 : nearness.shape[1]].astype(np.float32)
    dx, dy = (np.float32(deviation) * smooth(rng, nearness.shape, RAGGED_PX) for _ in range(2))
    moved = cv2.remap(nearness, columns + dx, rows + dy, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return np.where(edges(nearness, max(2, round(2 * deviation))), moved, nearness)


def shadows(nearness: Array, shift: float) -> Array:
    """(H, W) bool: what a second camera to the right does not see; ``shift`` is focal length times baseline in px m.

    A point at column x lies in its column x - shift / z. Going left, that column must fall; where it does not,
    something nearer and further right stands in the way.
    """
    column = np.arange(nearness.shape[1], dtype=np.float32)[None] - np.float32(shift) * nearness
    least = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(nearness.shape, bool)
    hidden[:, :-1] = column[:, :-1] > least[:, 1:] + 0.5
    return hidden
