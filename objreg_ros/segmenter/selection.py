# SPDX-License-Identifier: Apache-2.0
"""Which parts of a surface are the object that a box shows.

The box is evidence: it encloses the object tightly, give or take some percent. So parts that leave the box belong to
something else, and the right parts together fill it from edge to edge. What is only hidden by others is background.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array
from objreg_ros.segmenter.parts import Parts
from objreg_ros.segmenter.surface import Window

SLACK = 0.06  # of the box's size: how far its edges are off without saying anything
MIN_PURE = 0.6  # a part with less of it in the box belongs to something else
WHOLE = 0.95  # a part with at least this much of it in the box is wholly there
MIN_FIGURE = 0.25  # a part with less of its depth jumps its own silhouette is background
MIN_GAIN = 0.03  # in fit: what another part must add
SMALL_GAIN = 0.005  # what a part must add that is wholly there and touches
MIN_TOUCH = 3  # cells that two parts of one object touch in
GAP = 0.08  # of the box's size: how far apart two parts of one object are where they are neighbours
GAP_ALIKE = 0.25  # the same, for parts of one colour


def select(parts: Parts, window: Window) -> list[int]:
    """The numbers (from 1) of the parts of the object in ``window``; empty if no part is there.

    The seed fits the box best; parts next to what is selected are added while the fit gets better, and in the end
    those that lie within it and not on it, as the inside of a bowl does.
    """
    if len(parts) == 0:
        return []
    fits = np.array([_fit(extent, window) for extent in parts.extent])
    score = np.sqrt(parts.weight) * parts.pure**2 * (0.1 + fits) ** 2 * (0.2 + parts.figure)
    chosen = [int(score.argmax())]
    if _is_alone(parts, chosen[0]):
        return [chosen[0] + 1]
    while True:
        best = _best_addition(parts, chosen, window)
        if best is None:
            return [k + 1 for k in chosen + _enclosed(parts, chosen, window)]
        chosen.append(best)


def _is_alone(parts: Parts, seed: int) -> bool:
    """Whether no other part could be added: nothing next to it lies in the box."""
    near = parts.gap[seed] < GAP_ALIKE * parts.size[seed]  # parts that touch have a gap too, of one cell
    return not bool((near & (parts.pure >= MIN_PURE)).any())


def _touching(parts: Parts, chosen: list[int]) -> Array:
    """(K,) bool: the parts that touch ``chosen``."""
    return parts.touching[chosen].sum(axis=0) >= MIN_TOUCH


def _close(parts: Parts, chosen: list[int]) -> Array:
    """(K,) bool: the parts that a depth jump keeps from ``chosen``, but no more than within one object."""
    gap, size = parts.gap[chosen], parts.size[chosen[0]]
    return ((gap < GAP * size) | ((gap < GAP_ALIKE * size) & parts.alike[chosen])).any(axis=0)


def _lies_on(parts: Parts, chosen: list[int]) -> Array:
    """(K,) bool: the parts that hide more of ``chosen`` than it hides of them, and have another colour."""
    hides = parts.front[:, np.array(chosen) + 1].sum(axis=1)
    return (hides > parts.front[chosen, 1:].sum(axis=0)) & ~parts.alike[chosen].any(axis=0)


def _best_addition(parts: Parts, chosen: list[int], window: Window) -> int | None:
    """The part that adds most to the fit of ``chosen``; None if none adds enough."""
    touching = _touching(parts, chosen)
    no_background = (parts.figure >= MIN_FIGURE) | parts.alike[chosen].any(axis=0)
    near = touching | (_close(parts, chosen) & no_background)
    near[chosen] = False
    ease = touching & (parts.pure >= WHOLE) & ~_lies_on(parts, chosen)
    extent = _union(parts.extent[chosen])
    fit = _fit(extent, window)
    best, most = None, 0.0
    for k in np.flatnonzero(near & (parts.pure >= MIN_PURE)):
        gain = _fit(_union(np.array([extent, parts.extent[k]])), window) - fit
        if gain > most and gain > (SMALL_GAIN if ease[k] else MIN_GAIN):
            best, most = int(k), gain
    return best


def _enclosed(parts: Parts, chosen: list[int], window: Window) -> list[int]:
    """The parts within the extent of ``chosen`` that lie next to it and do not hide it."""
    extent = _union(parts.extent[chosen])
    slack = SLACK * np.array([window[2] - window[0], window[3] - window[1]])
    within = (parts.extent[:, :2] >= extent[:2] - slack).all(axis=1)
    within &= (parts.extent[:, 2:] <= extent[2:] + slack).all(axis=1)
    near = _touching(parts, chosen) | _close(parts, chosen)
    near[chosen] = False
    return [int(k) for k in np.flatnonzero(near & within & ~_lies_on(parts, chosen) & (parts.pure >= WHOLE))]


def _union(extents: Array) -> Array:
    return np.concatenate([extents[:, :2].min(axis=0), extents[:, 2:].max(axis=0)])


def _fit(extent: Array, window: Window) -> float:
    """Intersection over union of two boxes, the first one's edges moved by up to SLACK towards the second one's."""
    left, right = _snap(extent[0], extent[2], window[0], window[2])
    top, bottom = _snap(extent[1], extent[3], window[1], window[3])
    wide, tall = min(right, window[2]) - max(left, window[0]), min(bottom, window[3]) - max(top, window[1])
    if wide <= 0 or tall <= 0:
        return 0.0
    inner = wide * tall
    return inner / ((right - left) * (bottom - top) + (window[2] - window[0]) * (window[3] - window[1]) - inner)


def _snap(low: float, high: float, target_low: float, target_high: float) -> tuple[float, float]:
    slack = SLACK * (target_high - target_low)
    return (
        low + min(max(target_low - low, -slack), slack),
        high + min(max(target_high - high, -slack), slack),
    )
