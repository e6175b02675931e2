# SPDX-License-Identifier: Apache-2.0
"""What a camera sees of a scene: depth and colour as the sensors give them, and the truth behind them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numba as nb
import numpy as np

from objreg_ros.data import Array, Intrinsics
from objreg_ros.geometry import inverse
from objreg_ros.simulation.camera import KINECT, ColourSensor
from objreg_ros.simulation.model import Symmetry
from objreg_ros.simulation.noise import DepthSensor
from objreg_ros.simulation.params import ColourParams, DepthParams, StressParams
from objreg_ros.simulation.raster import Projection, rasterise
from objreg_ros.simulation.scene import Placed, Scene
from objreg_ros.simulation.shade import shade

BANDS = 8
ALONE_PX = 96
"""An object is drawn alone at about this size to see how much of it is hidden."""


@dataclass(frozen=True, eq=False)
class Seen:
    """An object that is visible in an image.

    ``xyxy (4,) float32`` px around its visible pixels, half open; ``pixels`` their count; ``visibility`` 0..1 the
    visible share of its outline, where what is hidden or outside the image counts as not visible; ``T_world_object``,
    ``T_camera_object (4, 4)``; ``symmetry`` of its shape.
    """

    instance: int
    label: str
    is_distractor: bool
    xyxy: Array
    pixels: int
    visibility: float
    T_world_object: Array
    T_camera_object: Array
    symmetry: Symmetry


@dataclass(frozen=True, eq=False)
class Rendering:
    """An image pair and its truth.

    ``depth (H, W) float32`` m as measured, 0 where nothing is; ``true_depth`` likewise without any error; ``rgb
    (H, W, 3) uint8`` or None; ``instance (H, W) uint16``, 0 for the room; ``seen`` every visible object.
    """

    depth: Array
    true_depth: Array
    rgb: Array | None
    instance: Array
    seen: tuple[Seen, ...]
    T_world_camera: Array
    intrinsics: Intrinsics

    @property
    def objects(self) -> tuple[Seen, ...]:
        """What is visible of the nine classes."""
        return tuple(o for o in self.seen if not o.is_distractor)


def render(
    scene: Scene,
    T_world_camera: Array,
    intrinsics: Intrinsics = KINECT,
    seed: int = 0,
    depth: DepthParams | None = None,
    colour: ColourParams | None = None,
    stress: StressParams | None = None,
    with_colour: bool = True,
    threads: int = 1,
) -> Rendering:
    """The image of ``scene`` from the optical frame ``T_world_camera``, as a pure function of its arguments.

    ``seed`` draws the sensors' noise. Without ``with_colour`` there is no ``rgb``. ``threads`` changes the time only.
    """
    stress = stress or StressParams()
    shape = (intrinsics.height, intrinsics.width)
    surfaces = scene.surfaces
    mesh = (surfaces.vertices, surfaces.faces, surfaces.open_surface)
    projection = Projection(*mesh, T_world_camera, intrinsics)
    nearness, triangle = np.empty(shape, np.float32), np.empty(shape, np.int32)
    measured, light = np.empty(shape, np.float32), np.empty((*shape, 3), np.uint16)
    sensor = DepthSensor(depth or DepthParams(), stress, seed, shape, surfaces)
    maps = scene.shadows if with_colour else None

    def draw(first: int, last: int) -> None:
        projection.fill(nearness, triangle, first, last)
        if maps is not None:
            light_of = (surfaces, T_world_camera, scene.lamps, scene.ambient, maps)
            shade(projection, nearness, triangle, *light_of, (first, last), light)

    _in_bands(draw, shape[0], threads)
    _in_bands(lambda a, b: sensor.sense(projection, nearness, triangle, (a, b), measured), shape[0], threads)
    rgb = _photograph(light, colour or ColourParams(), stress, seed, threads) if with_colour else None
    true_depth = np.divide(1, nearness, out=np.zeros(shape, np.float32), where=nearness > 0)
    instance = np.where(triangle >= 0, surfaces.instance[triangle], 0).astype(np.uint16)
    seen = see(scene, instance, T_world_camera, intrinsics)
    return Rendering(measured, true_depth, rgb, instance, seen, T_world_camera, intrinsics)


def _in_bands(work: Callable[[int, int], None], height: int, threads: int) -> None:
    """Do ``work(first row, last row)`` over all rows, in bands that several threads share."""
    if threads <= 1:
        work(0, height)
        return
    edges = np.linspace(0, height // 2, BANDS + 1).astype(int) * 2  # shading goes by pairs of rows
    edges[-1] = height
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, edges[:-1].tolist(), edges[1:].tolist()))


def _photograph(light: Array, colour: ColourParams, stress: StressParams, seed: int, threads: int) -> Array:
    sensor = ColourSensor(colour, stress, seed)
    raw, gains = sensor.exposed(light)
    rgb = np.empty(light.shape, np.uint8)
    _in_bands(lambda a, b: sensor.develop(raw, gains, (a, b), rgb), light.shape[0], threads)
    return rgb


@nb.njit(cache=True, nogil=True)
def _extents(instance, count):  # type: ignore[no-untyped-def]
    """(count, 5): x0, y0, x1, y1 (outside) and the number of pixels of every instance."""
    out = np.zeros((count, 5), np.int64)
    out[:, 0] = out[:, 1] = 2**31
    for y in range(instance.shape[0]):
        for x in range(instance.shape[1]):
            k = instance[y, x]
            if k == 0:
                continue
            out[k, 0], out[k, 1] = min(out[k, 0], x), min(out[k, 1], y)
            out[k, 2], out[k, 3] = max(out[k, 2], x + 1), max(out[k, 3], y + 1)
            out[k, 4] += 1
    return out


def see(scene: Scene, instance: Array, T_world_camera: Array, intrinsics: Intrinsics) -> tuple[Seen, ...]:
    """The truth of every object that has a pixel in the mask ``instance (H, W)``."""
    count = max((o.instance for o in scene.objects), default=0) + 1
    extents = _extents(instance, count)
    visible = [o for o in scene.objects if extents[o.instance, 4] > 0]
    T_camera_world = inverse(T_world_camera)
    return tuple(_seen(scene, o, extents[o.instance], T_world_camera, T_camera_world, intrinsics) for o in visible)


def _seen(scene: Scene, o: Placed, extent: Array, T_world_camera: Array, T_camera_world: Array, i: Intrinsics) -> Seen:
    alone = outline_pixels(scene, o.instance, T_world_camera, i)
    return Seen(
        instance=o.instance,
        label=o.label,
        is_distractor=o.is_distractor,
        xyxy=extent[:4].astype(np.float32),
        pixels=int(extent[4]),
        visibility=float(min(1.0, extent[4] / max(alone, 1.0))),
        T_world_object=o.T_world_object,
        T_camera_object=T_camera_world @ o.T_world_object,
        symmetry=o.model.symmetry,
    )


def outline_pixels(scene: Scene, instance: int, T_world_camera: Array, intrinsics: Intrinsics) -> float:
    """How many pixels the object would cover if nothing hid it and the image had no border."""
    first, last = scene.face_range[instance]
    s = scene.surfaces
    low, high = int(s.faces[first:last].min()), int(s.faces[first:last].max()) + 1
    vertices, faces = s.vertices[low:high], s.faces[first:last] - low
    camera, scale = _window(vertices, T_world_camera, intrinsics)
    _, triangle = rasterise(vertices, faces, s.open_surface[first:last], T_world_camera, camera)
    return float((triangle >= 0).sum()) * scale**2


def _window(vertices: Array, T_world_camera: Array, i: Intrinsics) -> tuple[Intrinsics, float]:
    """A camera that just holds all vertices at about ALONE_PX, and the size of its pixels in those of ``i``."""
    T = inverse(T_world_camera)
    camera = vertices @ T[:3, :3].T.astype(np.float32) + T[:3, 3].astype(np.float32)
    z = np.maximum(camera[:, 2], 0.1)
    u, v = i.fx * camera[:, 0] / z + i.cx, i.fy * camera[:, 1] / z + i.cy
    x0, y0, wide, tall = float(u.min()), float(v.min()), float(np.ptp(u)), float(np.ptp(v))
    scale = max(wide, tall, 1.0) / ALONE_PX
    window = Intrinsics(
        fx=i.fx / scale,
        fy=i.fy / scale,
        cx=(i.cx - x0) / scale,
        cy=(i.cy - y0) / scale,
        width=int(wide / scale) + 2,
        height=int(tall / scale) + 2,
    )
    return window, scale
