# SPDX-License-Identifier: Apache-2.0
"""A z-buffer rasteriser in homogeneous coordinates: which triangle each pixel sees, and how far away it is.

With the corners P0, P1, P2 of a triangle in the camera frame and the ray d of a pixel, the edge functions
``e = [P0 P1 P2]^-1 d`` are linear over the image, all of them are positive inside the triangle, their sum is 1/z, and
e/sum(e) are the perspective-correct barycentric coordinates (Olano and Greer, "Triangle scan conversion using 2D
homogeneous coordinates", 1997). Triangles that cross the camera's plane need no clipping, only their bounds do.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, transform
from objreg_ros.native import kernels

_KERNELS = kernels("raster")


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
        _KERNELS.set_up(vertices, faces, open_surface, camera, i.width, i.height, *into)

    def fill(self, nearness: Array, triangle: Array, y_first: int, y_last: int) -> None:
        """Draw rows y_first..y_last into ``nearness`` (1/z) and ``triangle`` (face, -1 for nothing)."""
        nearness[y_first:y_last] = 0.0
        triangle[y_first:y_last] = -1
        setup = (self.bounds, self.edges, self.inverse_depth)
        _KERNELS.fill(*setup, y_first, y_last, nearness, triangle)


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
