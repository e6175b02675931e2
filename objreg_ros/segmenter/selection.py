# SPDX-License-Identifier: Apache-2.0
"""Which parts of a surface are the object that a box shows.

The box is evidence: it encloses the object tightly, give or take some percent. So the parts that leave the box belong
to something else, and the right parts together fill the box from edge to edge.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.components import Parts

Window = tuple[int, int, int, int]

SLACK = 0.06  # of the box's size: how far its edges are off without saying anything
MIN_PURE = 0.5  # a part with less of it in the box belongs to something else
MIN_GAIN = 0.04  # in fit: what another part must add
MIN_CONTACT = 3  # cells that two parts of one object touch in


def select(parts: Parts, window: Window) -> list[int]:
    """The numbers (from 1) of the parts of the object in ``window``; empty if no part is there.

    The seed is the part with the best fit to the box and the most of its middle; parts that touch what is selected are
    added while the fit gets better.
    """
    if len(parts) == 0:
        return []
    pure = parts.inside / parts.total
    fits = np.array([_fit(extent, window) for extent in parts.extent])
    score = np.sqrt(parts.weight) * pure**2 * (0.1 + fits) ** 2
    chosen = [int(score.argmax())]
    while True:
        extent = _union(parts.extent[chosen])
        fit = _fit(extent, window)
        gains = np.full(len(parts), -1.0)
        for k in np.flatnonzero((parts.contact[chosen].sum(axis=0) >= MIN_CONTACT) & (pure >= MIN_PURE)):
            if k not in chosen:
                gains[k] = _fit(_union(np.array([extent, parts.extent[k]])), window) - fit
        best = int(gains.argmax())
        if gains[best] < MIN_GAIN:
            return [k + 1 for k in chosen]
        chosen.append(best)


def _union(extents: Array) -> Array:
    return np.concatenate([extents[:, :2].min(axis=0), extents[:, 2:].max(axis=0)])


def _fit(extent: Array, window: Window) -> float:
    """Intersection over union of two boxes, the first one's edges moved by up to SLACK towards the second one's."""
    size = np.array([window[2] - window[0], window[3] - window[1]] * 2)
    off = extent - np.array(window)
    near = np.array(window) + np.sign(off) * np.maximum(np.abs(off) - SLACK * size, 0)
    overlap = np.minimum(near[2:], window[2:]) - np.maximum(near[:2], window[:2])
    if overlap.min() <= 0:
        return 0.0
    inner = float(overlap.prod())
    return inner / (float((near[2:] - near[:2]).prod()) + float(size[:2].prod()) - inner)
