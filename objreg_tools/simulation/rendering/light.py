# SPDX-License-Identifier: Apache-2.0
"""Lamps, and the soft shadows that they and the open room throw, kept as variance shadow maps.

A shadow map holds mean and variance of the distance from the lamp; Chebyshev's inequality bounds the share of light
that reaches a point (Donnelly and Lauritzen, "Variance shadow maps", 2006). The same map, seen straight down from far
above and blurred widely, serves as ambient occlusion: how much of the room above a point is open.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import pose
from objreg_tools.simulation.rendering.raster import rasterise
from objreg_tools.simulation.rendering.surfaces import Surfaces

FAR_ABOVE_M = 60.0
"""From this distance the view straight down is as good as parallel."""


@dataclass(frozen=True, eq=False)
class Lamp:
    """A lamp at ``position (3,)`` m in the world; ``colour (3,)`` its linear light on a surface 2 m away."""

    position: Array
    colour: Array


@dataclass(frozen=True, eq=False)
class ShadowMaps:
    """K maps of S x S: ``moments (K, S, S, 2) float32`` mean and mean square of the distance beyond ``reference (K,)``.

    ``rotation (K, 3, 3)``, ``position (K, 3)`` and ``pinhole (K, 2)`` (focal length, principal point) say how a point
    of the world falls on each. Map 0 looks straight down (ambient occlusion), the others belong to the lamps.
    """

    moments: Array
    rotation: Array
    position: Array
    pinhole: Array
    reference: Array


def looking(eye: Array, target: Array, up: Array) -> Array:
    """The pose (4, 4) of a camera at ``eye`` that looks at ``target``, with ``up`` upwards in the image."""
    forward = np.asarray(target, float) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return pose(np.stack([right, np.cross(forward, right), forward], axis=1), eye)


def shadow_maps(
    surfaces: Surfaces, lamps: tuple[Lamp, ...], centre: Array, reach: float, size: int = 512
) -> ShadowMaps:
    """The maps of the surroundings of ``centre`` within ``reach`` metres: one from above and one per lamp."""
    above = centre + np.array([0.0, 0.0, FAR_ABOVE_M])
    views = [_view(above, centre, FAR_ABOVE_M / reach, np.array([0.0, 1.0, 0.0]), size, FAR_ABOVE_M)]
    for lamp in lamps:
        distance = float(np.linalg.norm(centre - lamp.position))
        sideways = np.array([0.0, 1.0, 0.03])
        views.append(_view(lamp.position, centre, max(distance / reach, 0.5), sideways, size, distance))
    texel_m = 2 * reach / size
    blurs = [0.06 / texel_m] + [0.012 / texel_m] * len(lamps)
    moments = [_moments(surfaces, T, camera, ref, blur) for (T, camera, ref), blur in zip(views, blurs, strict=True)]
    return ShadowMaps(
        moments=np.stack(moments),
        rotation=np.stack([T[:3, :3].T for T, _, _ in views]).astype(np.float32),
        position=np.stack([T[:3, 3] for T, _, _ in views]).astype(np.float32),
        pinhole=np.array([(camera.fx, camera.cx) for _, camera, _ in views], np.float32),
        reference=np.array([ref for _, _, ref in views], np.float32),
    )


def _view(eye: Array, target: Array, zoom: float, up: Array, size: int, ref: float) -> tuple[Array, Intrinsics, float]:
    """A square camera at ``eye`` whose half width is 1/zoom of its distance."""
    middle = (size - 1) / 2
    camera = Intrinsics(fx=zoom * size / 2, fy=zoom * size / 2, cx=middle, cy=middle, width=size, height=size)
    return looking(eye, target, up), camera, ref


def _moments(surfaces: Surfaces, T: Array, camera: Intrinsics, reference: float, blur_px: float) -> Array:
    """Blurred mean and mean square of the distance beyond ``reference``."""
    casting = surfaces.casts_shadow
    open_surface = np.ones(int(casting.sum()), bool)
    depth, _ = rasterise(surfaces.vertices, surfaces.faces[casting], open_surface, T, camera)
    beyond = np.where(depth > 0, depth - reference, np.float32(20.0))
    beyond = np.minimum(beyond, 20.0)
    both = np.stack([beyond, beyond**2], axis=-1)
    return cv2.GaussianBlur(both, (0, 0), max(blur_px, 0.5))
