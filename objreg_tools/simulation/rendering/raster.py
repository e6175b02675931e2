# SPDX-License-Identifier: Apache-2.0
"""A z-buffer rasteriser in homogeneous coordinates: which triangle each pixel sees, and how far away it is.

With the corners P0, P1, P2 of a triangle in the camera frame and the ray d of a pixel, the edge functions
``e = [P0 P1 P2]^-1 d`` are linear over the image, all of them are positive inside the triangle, their sum is 1/z, and
e/sum(e) are the perspective-correct barycentric coordinates (Olano and Greer, "Triangle scan conversion using 2D
homogeneous coordinates", 1997). Triangles that cross the camera's plane need no clipping, only their bounds do.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, transform

NEAR_M = 0.02
EDGE_SLACK_PX = 1e-3
"""Triangles are filled this much beyond their edges, so that rounding leaves no cracks between neighbours."""


@nb.njit(cache=True, nogil=True)
def _bounds(P, fx, fy, cx, cy, out):  # type: ignore[no-untyped-def]
    """Pixel bounds (x0, y0, x1, y1) of the part of triangle P (3, 3) beyond the near plane; False if there is none."""
    found = False
    for i in range(3):
        j = (i + 1) % 3
        for end in range(2):
            z, x, y = P[i, 2], P[i, 0], P[i, 1]
            if end == 1:  # where the edge i-j crosses the near plane
                if (P[i, 2] > NEAR_M) == (P[j, 2] > NEAR_M):
                    continue
                s = (NEAR_M - P[i, 2]) / (P[j, 2] - P[i, 2])
                z, x, y = NEAR_M, P[i, 0] + s * (P[j, 0] - P[i, 0]), P[i, 1] + s * (P[j, 1] - P[i, 1])
            if z < NEAR_M:
                continue
            u, v = fx * x / z + cx, fy * y / z + cy
            if not found:
                out[0], out[1], out[2], out[3] = u, v, u, v
            out[0], out[1] = min(out[0], u), min(out[1], v)
            out[2], out[3] = max(out[2], u), max(out[3], v)
            found = True
    return found


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _set_up(vertices, faces, open_surface, camera, width, height, first, last, bounds, edges, inverse_depth):  # type: ignore[no-untyped-def]
    """Bounds and edge functions of faces first..last; ``vertices`` are float64 in the camera frame.

    ``edges (F, 3, 3)`` and ``inverse_depth (F, 3)`` hold value at the bounds' first pixel, slope in u, slope in v.
    Bounds with x1 < x0 mean that nothing is to be drawn.
    """
    fx, fy, cx, cy = camera
    P = np.empty((3, 3))
    W = np.empty((3, 3))
    box = np.empty(4)
    for f in range(first, last):
        bounds[f, 0], bounds[f, 2] = 1, 0
        for i in range(3):
            for k in range(3):
                P[i, k] = vertices[faces[f, i], k]
        if P[0, 2] < NEAR_M and P[1, 2] < NEAR_M and P[2, 2] < NEAR_M:
            continue
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            W[i, 0] = P[a, 1] * P[b, 2] - P[a, 2] * P[b, 1]
            W[i, 1] = P[a, 2] * P[b, 0] - P[a, 0] * P[b, 2]
            W[i, 2] = P[a, 0] * P[b, 1] - P[a, 1] * P[b, 0]
        det = P[0, 0] * W[0, 0] + P[0, 1] * W[0, 1] + P[0, 2] * W[0, 2]
        if abs(det) < 1e-14 or (det > 0 and not open_surface[f]):
            continue
        if not _bounds(P, fx, fy, cx, cy, box):
            continue
        x0, y0 = max(0.0, np.ceil(box[0] - EDGE_SLACK_PX)), max(0.0, np.ceil(box[1] - EDGE_SLACK_PX))
        x1, y1 = min(width - 1.0, np.floor(box[2] + EDGE_SLACK_PX)), min(height - 1.0, np.floor(box[3] + EDGE_SLACK_PX))
        if x1 < x0 or y1 < y0:
            continue
        bounds[f, 0], bounds[f, 1], bounds[f, 2], bounds[f, 3] = int(x0), int(y0), int(x1), int(y1)
        s0, s1, s2 = 0.0, 0.0, 0.0
        for i in range(3):
            du, dv = W[i, 0] / fx / det, W[i, 1] / fy / det
            value = W[i, 2] / det + du * (x0 - cx) + dv * (y0 - cy)
            edges[f, i, 0], edges[f, i, 1], edges[f, i, 2] = value, du, dv
            s0, s1, s2 = s0 + value, s1 + du, s2 + dv
        inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2] = s0, s1, s2


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "arcp", "nsz"})
def _fill(bounds, edges, inverse_depth, first, last, y_first, y_last, nearness, triangle):  # type: ignore[no-untyped-def]
    """Draw faces first..last into the rows y_first..y_last of ``nearness`` (1/z, 0 for nothing) and ``triangle``."""
    slack = np.float32(EDGE_SLACK_PX)
    for f in range(first, last):
        x0, x1 = bounds[f, 0], bounds[f, 2]
        if x1 < x0 or bounds[f, 1] >= y_last or bounds[f, 3] < y_first:
            continue
        slope = inverse_depth[f, 1]
        for y in range(max(bounds[f, 1], y_first), min(bounds[f, 3] + 1, y_last)):
            dy = np.float32(y - bounds[f, 1])
            lo, hi = np.float32(0.0), np.float32(x1 - x0)
            for i in range(3):
                value = edges[f, i, 0] + edges[f, i, 2] * dy
                a = edges[f, i, 1]
                if a > 0:
                    lo = max(lo, -value / a - slack)
                elif a < 0:
                    hi = min(hi, -value / a + slack)
                elif value < 0:
                    hi = np.float32(-1.0)
            start, stop = x0 + int(np.ceil(lo)), x0 + int(np.floor(hi))
            row = inverse_depth[f, 0] + inverse_depth[f, 2] * dy
            for x in range(start, stop + 1):
                near = row + slope * np.float32(x - x0)
                if near > nearness[y, x] and near < np.float32(1.0 / NEAR_M):
                    nearness[y, x] = near
                    triangle[y, x] = f


class Projection:
    """The faces of a mesh set up for one camera; then any rows of the image can be filled, in any number of threads."""

    def __init__(
        self,
        vertices_world: Array,
        faces: Array,
        open_surface: Array,
        T_world_camera: Array,
        intrinsics: Intrinsics,
    ) -> None:
        count = len(faces)
        self.intrinsics = intrinsics
        self.bounds = np.empty((count, 4), np.int32)
        self.edges = np.empty((count, 3, 3), np.float32)
        self.inverse_depth = np.empty((count, 3), np.float32)
        vertices = transform(inverse(T_world_camera), vertices_world.astype(np.float64))
        i = intrinsics
        camera = (float(i.fx), float(i.fy), float(i.cx), float(i.cy))
        into = (self.bounds, self.edges, self.inverse_depth)
        _set_up(vertices, faces, open_surface, camera, i.width, i.height, 0, count, *into)

    def fill(self, nearness: Array, triangle: Array, y_first: int, y_last: int) -> None:
        """Draw rows y_first..y_last into ``nearness`` (1/z) and ``triangle`` (face, -1 for nothing)."""
        nearness[y_first:y_last] = 0.0
        triangle[y_first:y_last] = -1
        setup = (self.bounds, self.edges, self.inverse_depth)
        _fill(*setup, 0, len(self.bounds), y_first, y_last, nearness, triangle)


def rasterise(
    vertices_world: Array, faces: Array, open_surface: Array, T_world_camera: Array, intrinsics: Intrinsics
) -> tuple[Array, Array]:
    """Depth (H, W) float32 in metres along the optical axis, 0 where nothing is, and triangle (H, W) int32, -1 there.

    ``vertices_world (V, 3)``; ``faces (F, 3) int32``, counter-clockwise seen from outside; faces with ``open_surface
    (F,) bool`` are seen from both sides.
    """
    shape = (intrinsics.height, intrinsics.width)
    nearness, triangle = np.empty(shape, np.float32), np.empty(shape, np.int32)
    projection = Projection(vertices_world, faces, open_surface, T_world_camera, intrinsics)
    projection.fill(nearness, triangle, 0, intrinsics.height)
    depth = np.divide(1.0, nearness, out=np.zeros(shape, np.float32), where=nearness > 0)
    return depth, triangle
