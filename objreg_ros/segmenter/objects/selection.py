# SPDX-License-Identifier: Apache-2.0
"""The parts of a surface that are the object in a box.

The box is evidence: it encloses the object tightly, give or take some percent. So parts that leave the box belong to
something else, and the right parts together fill it from edge to edge. What is only hidden by others is background.
"""

from __future__ import annotations

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.segmenter.surface.cells import Window
from objreg_ros.segmenter.surface.parts import Parts

SLACK = 0.06  # of the box's size: how far its edges are off without saying anything
MIN_PURE = 0.6  # a part with less of it in the box belongs to something else
WHOLE = 0.95  # a part with at least this much of it in the box is wholly there
MIN_FIGURE = 0.25  # a part with less of its depth jumps its own silhouette is background
MIN_GAIN = 0.03  # in fit: what another part must add
SMALL_GAIN = 0.005  # what a part must add that is wholly there and touches
MIN_TOUCH = 3  # cells that two parts of one object touch in
GAP = 0.08  # of the box's size: how far apart two parts of one object are where they are neighbours
GAP_GAIN = 0.25  # what is added to it with the gain in fit
GAP_ALIKE = 0.25  # the same, for parts of one colour
AS_WIDE = 0.7  # of the width of both: what they share of it
FELLOW_GAIN = 0.08  # in fit: what a part must add that is only seen apart from the others, as a seat from its back
FELLOW_FIGURE = 0.5  # such a part with less of its depth jumps its own silhouette is background
FELLOW_DEPTH = 0.15  # of its depth: how much nearer or farther such a part may be


def select(parts: Parts, window: Window) -> Array:
    """(h, w) bool: the cells of the parts that are the object in ``window``; none if no part is there.

    The seed fits the box best; parts next to what is selected are added while the fit gets better, and in the end
    those that lie within it and not on it, as the inside of a bowl does.
    """
    return np.asarray(_select(parts, window))


@numba.njit(cache=True, nogil=True)
def _select(parts, window):  # type: ignore[no-untyped-def]
    table = _choose(parts, window)
    h, w = parts.labels.shape
    cells = np.empty((h, w), np.bool_)
    for i in range(h):
        for j in range(w):
            cells[i, j] = table[parts.labels[i, j]]
    return cells


@numba.njit(cache=True, nogil=True)
def _choose(parts, window):  # type: ignore[no-untyped-def]
    """(1 + K,) bool: which parts, by their numbers, are the object."""
    count = len(parts.total)
    table = np.zeros(count + 1, np.bool_)
    if count == 0:
        return table
    chosen = table[1:]
    best = seed = _seed(parts, window)
    while best >= 0:
        chosen[best] = True
        best = _best_addition(parts, chosen, seed, window)
    _add_enclosed(parts, chosen, seed, window)
    return table


@numba.njit(cache=True, nogil=True)
def _seed(parts, window):  # type: ignore[no-untyped-def]
    """The part that alone fits the box best."""
    best, most = 0, -1.0
    for k in range(len(parts.total)):
        fit = _fit(_extent(parts, k), window)
        score = np.sqrt(parts.weight[k]) * parts.pure[k] ** 2 * (0.1 + fit) ** 2 * (0.2 + parts.figure[k])
        if score > most:
            best, most = k, score
    return best


@numba.njit(cache=True, nogil=True)
def _touches(parts, chosen, k):  # type: ignore[no-untyped-def]
    """Whether part k touches what is chosen."""
    cells = 0
    for c in range(len(chosen)):
        if chosen[c]:
            cells += parts.touching[c, k + 1]
    return cells >= MIN_TOUCH


@numba.njit(cache=True, nogil=True)
def _is_as_wide(a, b):  # type: ignore[no-untyped-def]
    """Whether two extents lie above each other and are about as wide, as the inside and the outside of a bowl."""
    return min(a[2], b[2]) - max(a[0], b[0]) >= AS_WIDE * (max(a[2], b[2]) - min(a[0], b[0]))


@numba.njit(cache=True, nogil=True)
def _is_close(parts, chosen, seed, k, gain):  # type: ignore[no-untyped-def]
    """Whether a depth jump keeps part k from what is chosen, but no more than within one object.

    The jump may be the wider the more the part is needed to fill the box: its ``gain`` in fit."""
    for c in range(len(chosen)):
        limit = (GAP_ALIKE if parts.alike[c, k] else GAP + GAP_GAIN * gain) * parts.size[seed]
        if chosen[c] and parts.gap[c, k + 1] < limit * limit:
            return True
    return False


@numba.njit(cache=True, nogil=True)
def _is_fellow(parts, chosen, seed, k):  # type: ignore[no-untyped-def]
    """Whether part k, wholly in the box, has the colour of what is chosen and is about as far away."""
    as_far = abs(parts.size[k] / parts.size[seed] - 1) < FELLOW_DEPTH  # sizes are those of the box at a part's depth
    whole = parts.pure[k] >= WHOLE and parts.figure[k] >= FELLOW_FIGURE
    return whole and as_far and _has_its_colour(parts, chosen, k)


@numba.njit(cache=True, nogil=True)
def _has_its_colour(parts, chosen, k):  # type: ignore[no-untyped-def]
    has = False
    for c in range(len(chosen)):
        has |= chosen[c] & parts.alike[c, k]
    return has


@numba.njit(cache=True, nogil=True)
def _hides(parts, chosen, k):  # type: ignore[no-untyped-def]
    """Whether part k hides more of what is chosen than that hides of it."""
    lead = 0
    for c in range(len(chosen)):
        if chosen[c]:
            lead += parts.front[k, c + 1] - parts.front[c, k + 1]
    return lead > 0


@numba.njit(cache=True, nogil=True)
def _lies_on(parts, chosen, k):  # type: ignore[no-untyped-def]
    """Whether part k hides what is chosen, and has another colour."""
    return _hides(parts, chosen, k) and not _has_its_colour(parts, chosen, k)


@numba.njit(cache=True, nogil=True)
def _best_addition(parts, chosen, seed, window):  # type: ignore[no-untyped-def]
    """The part that adds most to the fit of what is chosen; -1 if none adds enough."""
    extent = _chosen_extent(parts, chosen)
    fit = _fit(extent, window)
    best, most = -1, 0.0
    for k in range(len(chosen)):
        if chosen[k] or parts.pure[k] < MIN_PURE:
            continue
        gain = _fit(_union(extent, _extent(parts, k)), window) - fit
        if gain <= most or gain <= SMALL_GAIN:
            continue
        touching = _touches(parts, chosen, k)
        stretch = gain if _is_as_wide(extent, _extent(parts, k)) else 0.0
        no_background = parts.figure[k] >= MIN_FIGURE or _has_its_colour(parts, chosen, k)
        near = touching or (no_background and _is_close(parts, chosen, seed, k, stretch))
        if not near and not (gain > FELLOW_GAIN and _is_fellow(parts, chosen, seed, k)):
            continue
        if gain > MIN_GAIN or (touching and parts.pure[k] >= WHOLE and not _lies_on(parts, chosen, k)):
            best, most = k, gain
    return best


@numba.njit(cache=True, nogil=True)
def _add_enclosed(parts, chosen, seed, window):  # type: ignore[no-untyped-def]
    """Add to ``chosen`` the parts within its extent that lie next to it and do not hide it."""
    left, top, right, bottom = _chosen_extent(parts, chosen)
    slack_u, slack_v = SLACK * (window[2] - window[0]), SLACK * (window[3] - window[1])
    before = chosen.copy()
    for k in range(len(chosen)):
        a, b, c, d = _extent(parts, k)
        within = a >= left - slack_u and b >= top - slack_v and c <= right + slack_u and d <= bottom + slack_v
        own = parts.figure[k] >= MIN_FIGURE and _has_its_colour(parts, before, k) and not _hides(parts, before, k)
        if before[k] or not (within or own) or parts.pure[k] < WHOLE or _lies_on(parts, before, k):
            continue
        chosen[k] = _touches(parts, before, k) or _is_close(parts, before, seed, k, 0.0)


@numba.njit(cache=True, nogil=True)
def _extent(parts, k):  # type: ignore[no-untyped-def]
    return parts.extent[k, 0], parts.extent[k, 1], parts.extent[k, 2], parts.extent[k, 3]


@numba.njit(cache=True, nogil=True)
def _chosen_extent(parts, chosen):  # type: ignore[no-untyped-def]
    extent = (1 << 30, 1 << 30, -1, -1)
    for k in range(len(chosen)):
        if chosen[k]:
            extent = _union(extent, _extent(parts, k))
    return extent


@numba.njit(cache=True, nogil=True)
def _union(a, b):  # type: ignore[no-untyped-def]
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


@numba.njit(cache=True, nogil=True)
def _fit(extent, window):  # type: ignore[no-untyped-def]
    """Intersection over union of two boxes, the first one's edges moved by up to SLACK towards the second one's."""
    left, right = _snap(extent[0], extent[2], window[0], window[2])
    top, bottom = _snap(extent[1], extent[3], window[1], window[3])
    wide, tall = min(right, window[2]) - max(left, window[0]), min(bottom, window[3]) - max(top, window[1])
    if wide <= 0 or tall <= 0:
        return 0.0
    inner = wide * tall
    return inner / ((right - left) * (bottom - top) + (window[2] - window[0]) * (window[3] - window[1]) - inner)


@numba.njit(cache=True, nogil=True)
def _snap(low, high, target_low, target_high):  # type: ignore[no-untyped-def]
    slack = SLACK * (target_high - target_low)
    return (
        low + min(max(target_low - low, -slack), slack),
        high + min(max(target_high - high, -slack), slack),
    )
