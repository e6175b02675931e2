# SPDX-License-Identifier: Apache-2.0
"""Two cameras that are built and timed as real ones are: a lens, a lag, a rolling shutter, motion blur, an offset.

* The depth image shows the pose of ``lag_ms`` before the colour image, and carries the same stamp.
* Row r of colour is exposed ``rolling_ms`` (r / H - 1/2) after the stamp, for ``blur_ms`` about that time. Light is
  drawn in bands of rows and at times of the exposure, so many that the picture moves half a pixel from one to the
  next (but at most `MOST_STEPS`), and their linear light is averaged. Two things are approximate: a band has one
  time, and rows are those of the pinhole picture, before the lens. Depth is taken at one time.
* Misregistration is a shift of the depth image, a rotation and a displacement of the depth camera, the same throughout
  a recording. Sizes are given; directions follow from the recording's seed.
* The lens bends both images, as with depth that a driver has registered to a colour image that it did not rectify.

The truth is that of the pinhole camera at the stamp, where colour is at the middle of its exposure: boxes and masks are
those of the rectified picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import interpolate, inverse, pose, rotation_angle, rotation_from_vector
from objreg_tools.simulation.params import ColourParams, DepthParams, DepthSensing, RigParams, StressParams
from objreg_tools.simulation.rendering.lens import SimulatedLens
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.render import Rendering, photograph, truth_of
from objreg_tools.simulation.rendering.shade import shade
from objreg_tools.simulation.rendering.view import RenderedView, draw
from objreg_tools.simulation.sensors.depth_sensors import measure, needs_light
from objreg_tools.simulation.world.scene import Scene

STEP_PX = 0.5
"""The motion of the picture in px from one band or time to the next."""
MOST_STEPS = 16
NEAREST_M = 0.7
"""Nearer surfaces move further than `STEP_PX`."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Where the camera is at any time: ``T_world_camera (N, 4, 4)`` at ``rate`` Hz, the first at 0 s."""

    T_world_camera: Array
    rate: float

    def at(self, seconds: float) -> Array:
        """The pose (4, 4), interpolated between two frames; beyond both ends the motion goes on as it was."""
        if len(self.T_world_camera) == 1:
            return np.asarray(self.T_world_camera[0])
        k = int(np.clip(np.floor(seconds * self.rate), 0, len(self.T_world_camera) - 2))
        return interpolate(self.T_world_camera[k], self.T_world_camera[k + 1], seconds * self.rate - k)


class Rig:
    """The cameras of one recording: ``take_picture`` makes a picture pair. ``seed`` is that of the recording."""

    def __init__(self, params: RigParams, camera: Intrinsics, seed: int) -> None:
        self.params, self.camera = params, camera
        rng = np.random.default_rng([seed, 43])
        angle = rng.uniform(0, 2 * np.pi)
        shift = params.misregistration_px * np.array([np.cos(angle), np.sin(angle)])
        axis, way = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
        rotation = rotation_from_vector(np.radians(params.misregistration_deg) * axis)
        self.T_colour_depth = pose(rotation, 1e-3 * params.misregistration_mm * way)
        self.depth_camera = replace(camera, cx=camera.cx + shift[0], cy=camera.cy + shift[1])
        bent = any(params.distortion)
        self.lens = SimulatedLens(camera, params.distortion) if bent else None
        self._depth_lens = SimulatedLens(self.depth_camera, params.distortion) if bent else None

    def take_picture(
        self,
        scene: Scene,
        motion: Motion,
        seconds: float,
        seed: int = 0,
        depth: DepthSensing | None = None,
        colour: ColourParams | None = None,
        stress: StressParams | None = None,
        threads: int = 1,
    ) -> Rendering:
        """The picture pair with the stamp ``seconds``, as `render` has it; ``seed`` draws the sensors' noise."""
        depth, stress = depth or DepthParams(), stress or StressParams()
        T = motion.at(seconds)
        earlier = motion.at(seconds - 1e-3 * self.params.lag_ms) @ self.T_colour_depth
        view = self._depth_view(scene, earlier, needs_light(depth), threads)
        measured = measure(view, scene.surfaces, depth, stress, seed, threads)
        rgb = photograph(self._light(scene, motion, seconds), colour or ColourParams(), stress, seed, threads)
        return truth_of(scene, draw(scene, T, self.camera, with_light=False), T, measured, rgb)

    def _depth_view(self, scene: Scene, T_world_camera: Array, with_light: bool, threads: int) -> RenderedView:
        if self._depth_lens is None:
            return draw(scene, T_world_camera, self.depth_camera, with_light, threads)
        return self._depth_lens.bend(draw(scene, T_world_camera, self._depth_lens.wide, with_light, threads))

    def _light(self, scene: Scene, motion: Motion, seconds: float) -> Array:
        """The light (H, W, 3) uint16 that the picture gets."""
        camera, top = (self.camera, 0) if self.lens is None else (self.lens.wide, self.lens.row)
        light = np.empty((camera.height, camera.width, 3), np.uint16)
        bands = self._steps(motion, seconds, self.params.rolling_ms)
        edges = np.linspace(0, camera.height // 2, bands + 1).astype(int) * 2  # shading goes by pairs of rows
        edges[-1] = camera.height
        for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            late = ((first + last - 1) / 2 - top) / max(self.camera.height - 1, 1) - 0.5
            middle = seconds + 1e-3 * self.params.rolling_ms * late
            self._expose(scene, motion, middle, camera, (first, last), light)
        return light if self.lens is None else self.lens.bent_light(light)

    def _expose(
        self, scene: Scene, motion: Motion, middle: float, camera: Intrinsics, rows: tuple[int, int], light: Array
    ) -> None:
        """Draw ``rows`` of ``light``: the mean of the linear light over the exposure."""
        moments = self._steps(motion, middle, self.params.blur_ms)
        total = np.zeros((rows[1] - rows[0], camera.width, 3), np.float32)
        for k in range(moments):
            T = motion.at(middle + 1e-3 * self.params.blur_ms * ((k + 0.5) / moments - 0.5))
            _draw_rows(scene, T, camera, rows, light)
            if moments > 1:
                total += light[rows[0] : rows[1]].astype(np.float32) ** 2
        if moments > 1:
            light[rows[0] : rows[1]] = np.sqrt(total / moments).astype(np.uint16)

    def _steps(self, motion: Motion, middle: float, milliseconds: float) -> int:
        """In how many steps a time about ``middle`` is taken."""
        if milliseconds == 0:
            return 1
        half = 5e-4 * milliseconds
        moved = inverse(motion.at(middle - half)) @ motion.at(middle + half)
        radians = rotation_angle(moved[:3, :3]) + float(np.linalg.norm(moved[:3, 3])) / NEAREST_M
        return int(np.clip(np.ceil(self.camera.fx * radians / STEP_PX), 1, MOST_STEPS))


def _draw_rows(scene: Scene, T_world_camera: Array, camera: Intrinsics, rows: tuple[int, int], light: Array) -> None:
    """Draw ``rows`` of ``light`` from one pose."""
    s = scene.surfaces
    projection = Projection(s.vertices, s.faces, s.open_surface, T_world_camera, camera)
    nearness, triangle = np.empty(light.shape[:2], np.float32), np.empty(light.shape[:2], np.int32)
    projection.fill(nearness, triangle, *rows)
    lit = (s, T_world_camera, scene.lamps, scene.ambient, scene.shadows, rows, light)
    shade(projection, nearness, triangle, *lit)
