# SPDX-License-Identifier: Apache-2.0
"""A pinhole camera's view of a scene before any sensor: nearness, faces and light of every pixel."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.shade import shade
from objreg_tools.simulation.world.scene import Scene

BANDS = 8


@dataclass(frozen=True, eq=False)
class RenderedView:
    """``nearness (H, W) float32`` 1/m, 0 where nothing is; ``triangle (H, W) int32``, -1 there.

    ``light (H, W, 3) uint16`` as `shade` has it, or None. ``projection`` knows the camera and the faces' planes.
    """

    projection: Projection
    nearness: Array
    triangle: Array
    light: Array | None

    @property
    def camera(self) -> Intrinsics:
        """The camera."""
        return self.projection.intrinsics

    def of_faces(self, values: Array, nothing: float = 0.0) -> Array:
        """(H, W): of ``values (F,)`` that of the face in every pixel, ``nothing`` where there is none."""
        return np.where(self.triangle >= 0, values[self.triangle], values.dtype.type(nothing))

    def cosines(self) -> Array:
        """(H, W) float32: the cosine between the ray of a pixel and the normal of its face; 1 where nothing is."""
        i, planes = self.camera, self.projection.inverse_depth
        a = self.of_faces(planes[:, 1]) * np.float32(i.fx)
        b = self.of_faces(planes[:, 2]) * np.float32(i.fy)
        dx = (np.arange(i.width, dtype=np.float32) - np.float32(i.cx))[None] / np.float32(i.fx)
        dy = (np.arange(i.height, dtype=np.float32) - np.float32(i.cy))[:, None] / np.float32(i.fy)
        c = self.nearness - a * dx - b * dy
        length = np.sqrt((a * a + b * b + c * c) * (1 + dx * dx + dy * dy))
        return np.divide(self.nearness, length, out=np.ones_like(length), where=length > 0)


def draw(
    scene: Scene, T_world_camera: Array, camera: Intrinsics, with_light: bool = True, threads: int = 1
) -> RenderedView:
    """The view of ``scene`` from the optical frame ``T_world_camera (4, 4)``; ``threads`` changes the time only."""
    shape = (camera.height, camera.width)
    surfaces = scene.surfaces
    mesh = (surfaces.vertices, surfaces.faces, surfaces.open_surface)
    projection = Projection(*mesh, T_world_camera, camera)
    nearness, triangle = np.empty(shape, np.float32), np.empty(shape, np.int32)
    light = np.empty((*shape, 3), np.uint16) if with_light else None
    maps = scene.shadows if with_light else None

    def fill(first: int, last: int) -> None:
        projection.fill(nearness, triangle, first, last)
        if maps is not None and light is not None:
            light_of = (surfaces, T_world_camera, scene.lamps, scene.ambient, maps)
            shade(projection, nearness, triangle, *light_of, (first, last), light)

    in_bands(fill, shape[0], threads)
    return RenderedView(projection, nearness, triangle, light)


def in_bands(work: Callable[[int, int], None], height: int, threads: int) -> None:
    """Do ``work(first row, last row)`` over all rows, in bands that several threads share."""
    if threads <= 1:
        work(0, height)
        return
    edges = np.linspace(0, height // 2, BANDS + 1).astype(int) * 2  # shading goes by pairs of rows
    edges[-1] = height
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, edges[:-1].tolist(), edges[1:].tolist()))
