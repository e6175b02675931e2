# SPDX-License-Identifier: Apache-2.0
"""Corners that are followed through the views of a stream, with their depth: what its motion is measured by.

Corners of Shi and Tomasi ("Good features to track", 1994), followed by pyramidal Lucas-Kanade (Bouguet, 2000) there and
back again.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View

MOST_CORNERS = 120
LEAST_CORNERS = 12  # with depth at both ends of a span
LEAST_SHARE = 0.4  # of the corners that are still followed; with fewer a span ends
QUALITY, SEPARATION_PX, BLOCK_PX = 0.01, 5, 5  # of corners, as `cv2.goodFeaturesToTrack` has them
FLOW = {
    "winSize": (13, 13),
    "maxLevel": 3,
    "criteria": (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.01),
}
AGAIN = cv2.OPTFLOW_USE_INITIAL_FLOW
DRIFT_PX = 3.0  # a corner that looks as it did first farther from where it was followed to is another one
BACK_PX = 0.5  # a corner that does not come back to where it was is lost
RIM_PX = 3  # a corner so near to the rim of the picture is lost
SPAN_SHARE = 0.14  # of the width of the picture: how far the corners of a span move
SPAN_S = 0.7  # the longest time of a span; a camera that rests has none
RESTING_SHARE = 0.02  # of the width of the picture: corners that have moved by less say nothing
EDGE = 0.06  # depths around a corner that differ by more than this share of them are those of an edge


class Span(NamedTuple):
    """Corners at two times of a stream: ``uv_first``, ``uv_last (n, 2)`` pixels of the view, and their depths
    ``z_first``, ``z_last (n,)`` in metres."""

    first_ns: int
    last_ns: int
    uv_first: Array
    z_first: Array
    uv_last: Array
    z_last: Array


class CornerTracks:
    """Follows the corners of one stream. `track_view` returns the span that a view ended, mostly None."""

    def __init__(self) -> None:
        self._grey: Array | None = None  # of the last view
        self._grey_first: Array | None = None
        self._uv = self._uv_first = np.zeros((0, 2), np.float32)
        self._z_first = np.zeros(0)
        self._first_ns, self._count = 0, 0
        self._span: tuple[Span, Array] | None = None  # as it would end now, with the grey of its last view

    def track_view(self, stamp_ns: int, view: View) -> Span | None:
        """Follow the corners into the next view. A view without grey is passed over."""
        if view.grey is None:
            return None
        grey, depth = view.grey, view.xyz[..., 2]
        if self._grey is None or self._grey.shape != grey.shape or stamp_ns <= self._first_ns:
            self._begin(stamp_ns, grey, depth)
            return None
        self._follow(grey)
        self._grey = grey
        if len(self._uv) >= LEAST_CORNERS:
            self._go_on(stamp_ns, grey, depth)
        if not self._is_over(stamp_ns, grey.shape[1]):
            return None
        span = self._ended()
        self._begin(stamp_ns, grey, depth)
        return None if span is None or _moved(span) < RESTING_SHARE * grey.shape[1] else span

    def _begin(self, stamp_ns: int, grey: Array, depth: Array) -> None:
        """Begin a span with this view."""
        found = cv2.goodFeaturesToTrack(grey, MOST_CORNERS, QUALITY, SEPARATION_PX, blockSize=BLOCK_PX)
        uv = np.zeros((0, 2), np.float32) if found is None else found[:, 0].astype(np.float32)
        z = depth_at(depth, uv)
        known = np.isfinite(z)
        self._grey = self._grey_first = grey
        self._first_ns, self._span = stamp_ns, None
        self._uv, self._uv_first, self._z_first = uv[known], uv[known], z[known]
        self._count = len(self._uv)

    def _follow(self, grey: Array) -> None:
        """Go on with the corners that are found in the next picture, and from there in the last one again."""
        if not len(self._uv):
            return
        assert self._grey is not None
        uv, there, _ = cv2.calcOpticalFlowPyrLK(self._grey, grey, self._uv[:, None], None, **FLOW)
        back, again, _ = cv2.calcOpticalFlowPyrLK(grey, self._grey, uv, None, **FLOW)
        uv, back = uv[:, 0], back[:, 0]
        rim = np.array([grey.shape[1], grey.shape[0]]) - RIM_PX
        kept = (there[:, 0] > 0) & (again[:, 0] > 0) & (np.linalg.norm(back - self._uv, axis=1) < BACK_PX)
        kept &= (uv > RIM_PX).all(axis=1) & (uv < rim).all(axis=1)
        self._uv, self._uv_first, self._z_first = uv[kept], self._uv_first[kept], self._z_first[kept]

    def _go_on(self, stamp_ns: int, grey: Array, depth: Array) -> None:
        """Let the span reach to this view, where enough corners have a depth in it."""
        z = depth_at(depth, self._uv)
        known = np.isfinite(z)
        if np.count_nonzero(known) >= LEAST_CORNERS:
            first = self._uv_first[known], self._z_first[known]
            self._span = Span(self._first_ns, stamp_ns, *first, self._uv[known], z[known]), grey

    def _ended(self) -> Span | None:
        """The span with its corners found in the last view by how they looked in the first: from view to view they
        drift. Their depths are moved along with them, by less than a pixel."""
        if self._span is None:
            return None
        span, grey = self._span
        uv, there, _ = cv2.calcOpticalFlowPyrLK(
            self._grey_first, grey, span.uv_first[:, None], span.uv_last[:, None].copy(), **FLOW, flags=AGAIN
        )
        uv = uv[:, 0]
        kept = (there[:, 0] > 0) & (np.linalg.norm(uv - span.uv_last, axis=1) < DRIFT_PX)
        if np.count_nonzero(kept) < LEAST_CORNERS:
            return None
        first = span.uv_first[kept], span.z_first[kept]
        return Span(span.first_ns, span.last_ns, *first, uv[kept], span.z_last[kept])

    def _is_over(self, stamp_ns: int, width: int) -> bool:
        few = len(self._uv) < max(LEAST_CORNERS, LEAST_SHARE * self._count)
        late = 1e-9 * (stamp_ns - self._first_ns) > SPAN_S
        return few or late or (self._span is not None and _moved(self._span[0]) > SPAN_SHARE * width)


def _moved(span: Span) -> float:
    """How far the corners of a span have moved, px; the median."""
    return float(np.median(np.linalg.norm(span.uv_last - span.uv_first, axis=1)))


def depth_at(depth: Array, uv: Array) -> Array:
    """Depth (n,) at pixels ``uv (n, 2)`` between those of ``depth (h, w)``: the plane through the 3 × 3 around each.

    NaN where one of these is unknown, or where they are those of an edge.
    """
    height, width = depth.shape
    if not len(uv) or min(height, width) < 3:
        return np.full(len(uv), np.nan)
    centre = np.clip(np.rint(uv).astype(int), 1, [width - 2, height - 2])
    around = [depth[centre[:, 1] + i, centre[:, 0] + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    window = np.stack(around, axis=1).astype(float)
    right = (window[:, 2::3].mean(axis=1) - window[:, 0::3].mean(axis=1)) / 2
    down = (window[:, 6:].mean(axis=1) - window[:, :3].mean(axis=1)) / 2
    offset = uv - centre
    mean = window.mean(axis=1)
    edge = ~(window.max(axis=1) - window.min(axis=1) <= EDGE * mean)
    return np.where(edge, np.nan, mean + right * offset[:, 0] + down * offset[:, 1])
