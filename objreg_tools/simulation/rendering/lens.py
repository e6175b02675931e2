# SPDX-License-Identifier: Apache-2.0
"""A pinhole camera's view through a lens with plumb-bob distortion (k1, k2, p1, p2, k3; OpenCV's model)."""

from __future__ import annotations

import copy

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.view import RenderedView

ITERATIONS = 60
MOST_ERROR_PX = 0.02
MOST_OFF_PX = 1e5
"""Beyond this the iteration has diverged."""
MARGIN_PX = 2
WIDEST = 3.0
"""A drawn view is at most this many times as wide and as high as the picture."""


class SimulatedLens:
    """A lens before a camera: draw the view of ``wide``, a pinhole camera that sees all of the picture, and bend it.

    ``rays (H, W, 2) float32`` are x/z and y/z of what every pixel of the picture sees; ``row`` and ``column`` are where
    the pinhole picture starts in that of ``wide``. ValueError for a distortion that bends two rays into one pixel.
    """

    def __init__(self, camera: Intrinsics, distortion: tuple[float, ...]) -> None:
        self.camera = i = camera
        self.distortion = tuple(float(d) for d in distortion)
        rays, off = _rays(i, np.array(self.distortion))
        u, v = rays[:, 0] * i.fx + i.cx, rays[:, 1] * i.fy + i.cy
        fits = np.ptp(u) < WIDEST * i.width and np.ptp(v) < WIDEST * i.height
        if not off < MOST_ERROR_PX or not fits:
            raise ValueError(
                f"distortion: expected one that gives every pixel of {i.width}x{i.height} a ray of its own, "
                f"got {self.distortion}; take smaller numbers or a narrower camera"
            )
        self.rays = rays.reshape(i.height, i.width, 2).astype(np.float32)
        self.column, self.row = (max(0, int(np.ceil(-low.min()))) + MARGIN_PX for low in (u, v))
        right, bottom = max(i.width, int(np.ceil(u.max()))), max(i.height, int(np.ceil(v.max())))
        self.wide = Intrinsics(
            fx=i.fx,
            fy=i.fy,
            cx=i.cx + self.column,
            cy=i.cy + self.row,
            width=self.column + right + MARGIN_PX,
            height=self.row + bottom + MARGIN_PX,
        )
        shape = (i.height, i.width)
        self._u = (u + self.column).reshape(shape).astype(np.float32)
        self._v = (v + self.row).reshape(shape).astype(np.float32)

    def bend(self, view: RenderedView) -> RenderedView:
        """The view of ``wide`` as it lies in the picture: nearness exactly on the plane of the face that is nearest."""
        x, y = np.rint(self._u).astype(int), np.rint(self._v).astype(int)
        triangle = view.triangle[y, x]
        p = view.projection
        start, slope = p.bounds[triangle], p.inverse_depth[triangle]
        on_plane = slope[..., 0] + slope[..., 1] * (self._u - start[..., 0]) + slope[..., 2] * (self._v - start[..., 1])
        nearness = np.where((triangle >= 0) & (on_plane > 0), on_plane, view.nearness[y, x]).astype(np.float32)
        projection = copy.copy(p)
        projection.intrinsics = self.camera
        return RenderedView(projection, nearness, triangle, None if view.light is None else self.bent_light(view.light))

    def bent_light(self, light: Array) -> Array:
        """The light (H', W', 3) uint16 of ``wide`` as it lies in the picture (H, W, 3)."""
        return cv2.remap(light, self._u, self._v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def _rays(i: Intrinsics, distortion: Array) -> tuple[Array, float]:
    """x/z and y/z (N, 2) of every pixel, row by row, and by how many pixels they miss it at most.

    By fixed-point iteration, as OpenCV does it: its own stops after five steps.
    """
    rows, columns = np.mgrid[0 : i.height, 0 : i.width].astype(float)
    bent = np.stack([(columns - i.cx) / i.fx, (rows - i.cy) / i.fy], -1).reshape(-1, 2)
    rays, focal, none = bent.copy(), np.array([i.fx, i.fy]), np.zeros(3)
    off = np.inf
    for _ in range(ITERATIONS):
        seen = cv2.projectPoints(np.column_stack([rays, np.ones(len(rays))]), none, none, np.eye(3), distortion)[0]
        miss = bent - seen.reshape(-1, 2)
        off = float(np.abs(miss * focal).max())
        if not MOST_ERROR_PX / 10 < off < MOST_OFF_PX:
            break
        rays = rays + miss
    return rays, off
