# SPDX-License-Identifier: Apache-2.0
"""Properties of the connected parts in and around a box: size, place, and how they lie to each other."""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.segmenter.surface.cells import Surface, Window

_KERNELS = kernels("parts")
RIM = 0.7  # how much less a cell at the rim of the box counts than one in its middle


class Parts(NamedTuple):
    """K connected parts of a surface, the largest in the box first, numbered from 1 in ``labels (h, w) int32``.

    Of each part: ``total (K,)`` its cells, ``weight (K,)`` those in the box where the middle counts more than the rim,
    ``extent (K, 4)`` left, top, right, bottom in cells, half open, ``size (K,)`` the length in metres of the box's
    longer side at the part's depth, ``pure (K,)`` which share of it lies in the box, ``figure (K,)`` which share of its
    depth jumps is its own silhouette, 1 where it has none.

    Of each pair: ``alike (K, K)`` whether they have one colour in whatever light, False without colour, ``touching
    (K, 1 + K)`` the cells in which they are neighbours without a depth jump, ``gap (K, 1 + K)`` m² the square of the
    least distance over a border, ``front (K, 1 + K)`` the cells in which the first hides the second; column 0 is what
    is no part.
    """

    labels: Array
    total: Array
    weight: Array
    extent: Array
    size: Array
    pure: Array
    figure: Array
    alike: Array
    touching: Array
    gap: Array
    front: Array


def measure(
    labels: Array, count: int, window: Window, surface: Surface, rgb: Array, jump: tuple[float, float], limit: int
) -> Parts:
    """The ``limit`` largest parts of ``labels (h, w) int32``, 0 … ``count``, by their cells in ``window``.

    ``rgb (H, W, 3) uint8`` is the whole picture, of height 0 without colour.
    """
    pixels = (surface.left, surface.top, surface.step)
    grid = (surface.depth, surface.x, surface.y)
    labels, total, weight, extent, size, pure, figure, alike, touching, gap, front = _KERNELS.measure(
        labels, count, window, *grid, pixels, rgb, jump, RIM, limit
    )
    pairs = (touching[1:], gap[1:], front[1:])
    return Parts(labels, total, weight, extent[1:], size, pure, figure, alike, *pairs)
