# SPDX-License-Identifier: Apache-2.0
"""A short vector that says how an object looks: the nearer two of them, the likelier the same object.

Size, the histogram of distances between pairs of points (D2; Osada et al., "Shape distributions", 2002) and colour.
None of them needs a coordinate frame, so they change only as the visible side does.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud

PAIRS = 512
DISTANCE_EDGES = np.array([0, 0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4, 0.6, np.inf])
HUES = 8
SIZE_WEIGHT, SHAPE_WEIGHT, COLOUR_WEIGHT = 0.5, 1.0, 0.7
SIZE = 3 + (len(DISTANCE_EDGES) - 1) + HUES + 4  # extents, D2, hues, greys

EMPHASIS = np.repeat(np.array([0.7, 1.0, 1.4], np.float32), [3, len(DISTANCE_EDGES) - 1, HUES + 4])
"""Weights of the parts of a stored descriptor in retrieval: in many rooms colour separates objects better than size."""


def describe(cloud: ObjectCloud) -> Array:
    """The (SIZE,) float32 descriptor of an object; without colour the colour's share is 0."""
    extents = SIZE_WEIGHT * _extents(cloud.xyz)
    shape = SHAPE_WEIGHT * _distances(cloud.xyz)
    colour = np.zeros(HUES + 4) if cloud.rgb is None else COLOUR_WEIGHT * _colours(cloud.rgb)
    return np.concatenate([extents, shape, colour]).astype(np.float32)


def _extents(xyz: Array) -> Array:
    """The logarithms of the spread along the principal axes, in units of a doubling, from 1 cm."""
    if len(xyz) < 3:
        return np.zeros(3)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(xyz.T.astype(float))), 0.0))[::-1]
    return np.asarray(np.log2(np.maximum(spread, 0.0025) / 0.01))


def _distances(xyz: Array) -> Array:
    """The root of the share of point pairs in each class of distance. The same points always give the same pairs."""
    if len(xyz) < 2:
        return np.zeros(len(DISTANCE_EDGES) - 1)
    a, b = np.random.default_rng(0).integers(0, len(xyz), (2, PAIRS))
    distance = np.linalg.norm(xyz[a] - xyz[b], axis=1)
    return np.sqrt(np.histogram(distance, DISTANCE_EDGES)[0] / PAIRS)


def _colours(rgb: Array) -> Array:
    """The roots of the shares of hues of the colourful points and of four greys of the others."""
    colour = rgb.astype(np.float32) / 255.0
    value, least = colour.max(axis=1), colour.min(axis=1)
    chroma = value - least
    vivid = chroma > 0.25 * np.maximum(value, 0.2)
    counts = np.zeros(HUES + 4)
    counts[:HUES] = np.bincount(_hue_class(colour[vivid], value[vivid], chroma[vivid]), minlength=HUES)
    greys = np.minimum((4 * value[~vivid]).astype(int), 3)
    counts[HUES:] = np.bincount(greys, minlength=4)
    return np.sqrt(counts / max(len(rgb), 1))


def _hue_class(colour: Array, value: Array, chroma: Array) -> Array:
    r, g, b = colour.T
    sector = np.select(
        [value == r, value == g], [(g - b) / chroma % 6.0, (b - r) / chroma + 2.0], (r - g) / chroma + 4.0
    )
    return np.minimum((sector / 6.0 * HUES).astype(int), HUES - 1)
