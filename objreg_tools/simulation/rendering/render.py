# SPDX-License-Identifier: Apache-2.0
"""A camera's view of a scene: depth and colour as the sensors give them, and the truth behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse
from objreg_ros.native import kernels
from objreg_tools.simulation.params import ColourParams, DepthParams, DepthSensing, StressParams
from objreg_tools.simulation.rendering.raster import rasterise
from objreg_tools.simulation.rendering.view import RenderedView, draw, in_bands
from objreg_tools.simulation.sensors.camera import KINECT, ColourSensor
from objreg_tools.simulation.sensors.depth_sensors import measure, needs_light
from objreg_tools.simulation.world.model import Symmetry
from objreg_tools.simulation.world.scene import Placed, Scene

_KERNELS = kernels("render")
ALONE_PX = 96
"""An object is drawn alone at about this size to see how much of it is hidden."""


@dataclass(frozen=True, eq=False)
class SeenPixels:
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
    seen: tuple[SeenPixels, ...]
    T_world_camera: Array
    intrinsics: Intrinsics

    @property
    def objects(self) -> tuple[SeenPixels, ...]:
        """The visible objects of the nine classes."""
        return tuple(o for o in self.seen if not o.is_distractor)


def render(
    scene: Scene,
    T_world_camera: Array,
    intrinsics: Intrinsics = KINECT,
    seed: int = 0,
    depth: DepthSensing | None = None,
    colour: ColourParams | None = None,
    stress: StressParams | None = None,
    with_colour: bool = True,
    threads: int = 1,
) -> Rendering:
    """The image of ``scene`` from the optical frame ``T_world_camera``, as a pure function of its arguments.

    ``seed`` draws the sensors' noise. Without ``with_colour`` there is no ``rgb``. ``threads`` changes the time only.
    """
    depth, stress = depth or DepthParams(), stress or StressParams()
    view = draw(scene, T_world_camera, intrinsics, with_colour or needs_light(depth), threads)
    measured = measure(view, scene.surfaces, depth, stress, seed, threads)
    rgb = photograph(view.light, colour or ColourParams(), stress, seed, threads) if with_colour else None
    return truth_of(scene, view, T_world_camera, measured, rgb)


def truth_of(scene: Scene, view: RenderedView, T_world_camera: Array, measured: Array, rgb: Array | None) -> Rendering:
    """The measurement, with the truth of a view."""
    nearness, triangle = view.nearness, view.triangle
    true_depth = np.divide(1, nearness, out=np.zeros(nearness.shape, np.float32), where=nearness > 0)
    instance = np.where(triangle >= 0, scene.surfaces.instance[triangle], 0).astype(np.uint16)
    seen = see(scene, instance, T_world_camera, view.camera)
    return Rendering(measured, true_depth, rgb, instance, seen, T_world_camera, view.camera)


def photograph(light: Array | None, colour: ColourParams, stress: StressParams, seed: int, threads: int) -> Array:
    """(H, W, 3) uint8: the picture of ``light (H, W, 3) uint16``, as `shade` has it."""
    if light is None:
        raise ValueError("expected a view with light to photograph, got one without")
    sensor = ColourSensor(colour, stress, seed)
    raw, gains = sensor.exposed(light)
    rgb = np.empty(light.shape, np.uint8)
    in_bands(lambda a, b: sensor.develop(raw, gains, (a, b), rgb), light.shape[0], threads)
    return rgb


def see(scene: Scene, instance: Array, T_world_camera: Array, intrinsics: Intrinsics) -> tuple[SeenPixels, ...]:
    """The truth of every object that has a pixel in the mask ``instance (H, W)``."""
    count = max((o.instance for o in scene.objects), default=0) + 1
    extents = _KERNELS.extents(instance, count)
    visible = [o for o in scene.objects if extents[o.instance, 4] > 0]
    T_camera_world = inverse(T_world_camera)
    return tuple(_seen(scene, o, extents[o.instance], T_world_camera, T_camera_world, intrinsics) for o in visible)


def _seen(
    scene: Scene, o: Placed, extent: Array, T_world_camera: Array, T_camera_world: Array, i: Intrinsics
) -> SeenPixels:
    alone = outline_pixels(scene, o.instance, T_world_camera, i)
    return SeenPixels(
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
