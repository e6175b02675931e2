# SPDX-License-Identifier: Apache-2.0
"""One object, or several together, made ready to be registered upright: points about a footing, and a silhouette."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import PointFlag
from objreg_ros.geometry import pose
from objreg_ros.native import kernels
from objreg_ros.registration.kernels.closest_points import IndexedSurface, prepare_surface
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.shapes.silhouette import Silhouette, draw

_KERNELS = kernels("shape")
EDGE = np.uint16(PointFlag.EDGE)
LEAST = 30  # points of a shape
CLEAR = 0.005  # m: what an object stands on is at most so much higher than the lowest that is seen of it
STEP = 0.02  # m: a level surface lies within as much of height
SEEN = 5  # points of the context that make one
LAYER = 0.05  # of the points of the widest: less is a rung or a rim, and nothing stands on it
BESIDE, AROUND = 0.02, 0.25  # m beyond the object: nearer points may be its own
WIDE = 0.6  # m beyond the object: what lies there in the same plane gives the up direction
THICK = (0.03, 0.02, 0.015, 0.015)  # m beside a plane, round by round
PLANE = 60  # points that make one
RIM = 0.02, 0.98  # of the points: between these an object is as wide as it looks
NOWHERE = np.array([[np.inf, np.inf], [-np.inf, -np.inf]], np.float32)  # a box that holds nothing
MOST_TILT = 4.0  # degrees between gravity and the normal of what objects stand on


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """Points and normals (N, 3) float32 in upright axes (z against gravity) about ``origin``, in a shuffled order.

    ``shades (N,) float32`` is their grey; the first ``most`` of them are laid upon other shapes. ``R_upright_camera
    (3, 3)`` and the ``origin (3,)`` in upright axes: the middle of the object in its plane, and the height of what it
    stands on; ``extent`` m is its width.
    """

    xyz: Array
    normals: Array
    shades: Array
    most: int
    silhouette: Silhouette
    R_upright_camera: Array
    origin: Array
    extent: float

    @property
    def foot(self) -> Array:
        """The origin (3,) in the camera frame."""
        return self.R_upright_camera.T @ self.origin

    @cached_property
    def surface(self) -> IndexedSurface:
        """What other shapes are laid upon: twice as many points, and the grid that knows the closest."""
        dense = slice(2 * self.most)
        return prepare_surface(self.xyz[dense], self.normals[dense], *_cells(self.xyz))

    @property
    def kernel_arrays(self) -> tuple[Any, ...]:
        """The points and what the camera saw, for the kernels."""
        s, few = self.silhouette, slice(self.most)
        points = self.xyz[few], self.normals[few], self.shades[few]
        image = s.depth, s.mask, s.grey, s.camera, s.tolerance
        return (*points, self.R_upright_camera, self.origin, *image, s.inward, s.edges)


def prepare_shape(
    keyframe: Keyframe,
    indices: Sequence[int],
    most: int,
    seed: int = 0,
    noise: float = 1.0,
    layers: Sequence[Array] | None = None,
) -> Shape | None:
    """The objects ``indices`` of a keyframe as one shape of at most ``most`` points.

    ``noise`` is the `depth_noise` of its view; ``layers`` are the `layer_around` each of its objects, computed here
    where not given. None without gravity or with too few points.
    """
    clouds = [keyframe.objects[i].cloud for i in indices]
    if keyframe.gravity is None or sum(len(cloud) for cloud in clouds) < LEAST:
        return None
    xyz = np.concatenate([cloud.xyz for cloud in clouds])
    grey = np.concatenate([_grey(cloud.rgb, len(cloud)) for cloud in clouds])
    firm = np.concatenate([(cloud.normals != 0).any(axis=1) & ((cloud.flags & EDGE) == 0) for cloud in clouds])
    normals = np.concatenate([cloud.normals for cloud in clouds])
    if firm.sum() < LEAST:
        firm = (normals != 0).any(axis=1)
    if firm.sum() < LEAST:
        return None
    R = upright_axes(standing(keyframe, indices, -np.asarray(keyframe.gravity, float), layers))
    feet = [footing(keyframe, i, R) for i in indices]
    upright = xyz @ R.T.astype(np.float32)
    low, high = np.transpose([_rim(upright[:, axis]) for axis in (0, 1)])
    origin = np.array([*(low + high) / 2.0, np.median(feet)])
    order = np.random.default_rng(seed).permutation(np.flatnonzero(firm))
    points = np.ascontiguousarray(upright[order] - origin.astype(np.float32))
    facing = np.ascontiguousarray(normals[order] @ R.T.astype(np.float32))
    extent = float(np.linalg.norm(high - low))
    return Shape(
        xyz=points,
        normals=facing,
        shades=grey[order],
        most=most,
        silhouette=draw(xyz, grey, keyframe.view, noise),
        R_upright_camera=R,
        origin=origin,
        extent=extent,
    )


def _cells(points: Array) -> tuple[float, float]:
    """(cell, reach) m of the grid of a shape."""
    cell = max(float(np.ptp(points, axis=0).max()) / 40.0, 0.005)
    return cell, min(0.07, 10.0 * cell)


def _grey(rgb: Array | None, count: int) -> Array:
    if rgb is None or count == 0:
        return np.zeros(count, np.float32)
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(rgb[None]), cv2.COLOR_RGB2GRAY)[0], np.float32)


def upright_axes(up: Array) -> Array:
    """``R_upright_camera (3, 3)``: z along ``up``, x along what of the optical axis is level."""
    ahead = np.array([0.0, 0.0, 1.0]) if abs(up[2]) < 0.99 else np.array([0.0, -1.0, 0.0])
    x = ahead - up * (ahead @ up)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])


def standing(keyframe: Keyframe, indices: Sequence[int], up: Array, layers: Sequence[Array] | None = None) -> Array:
    """Up (3,) as the normal of what the objects stand on: truer than ``up``, which is the guess against gravity.

    The planes under several objects are parallel. ``up`` itself where too little of them is seen, or they tilt.
    ``layers`` are the `layer_around` each object of the keyframe, computed here where not given.
    """
    R = upright_axes(up)
    beneath = [layer_around(keyframe, i, up) if layers is None else layers[i] for i in indices]
    points = np.concatenate([np.zeros((0, 3)), *(layer for layer in beneath if len(layer) >= PLANE)])
    slope = np.zeros(2)
    for thickness in THICK:
        kept = np.abs(points[:, 2] - points[:, :2] @ slope) < thickness
        if kept.sum() < PLANE:
            return up
        level, height = points[kept, :2], points[kept, 2]
        slope, *_ = np.linalg.lstsq(level.T @ level, level.T @ height, rcond=None)
    if np.hypot(*slope) > np.tan(np.radians(MOST_TILT)):
        return up
    normal = R.T @ np.array([-slope[0], -slope[1], 1.0])
    return np.asarray(normal / np.linalg.norm(normal))


def layer_around(keyframe: Keyframe, index: int, up: Array) -> Array:
    """Level points (N, 3) around an object at the height that it stands on, about their own middle, z along ``up``."""
    R = upright_axes(up).astype(np.float32)
    points = keyframe.objects[index].cloud.xyz @ R.T
    foot = _footing(keyframe, points, R)
    middle = points.mean(axis=0)
    beside = np.array([middle[:2] - WIDE, middle[:2] + WIDE], np.float32)
    around = keyframe.context.xyz, keyframe.context.normals, R
    layer = _KERNELS.level(*around, beside, NOWHERE, foot - THICK[0], foot + THICK[0])
    return np.asarray(layer - np.median(layer, axis=0) if len(layer) else layer, float)


def footing(keyframe: Keyframe, index: int, R_upright_camera: Array) -> float:
    """The height along up of what an object stands on: of the level surface around it, else of its lowest points.

    Around, not within: a seat is level too.
    """
    R = R_upright_camera.astype(np.float32)
    return _footing(keyframe, keyframe.objects[index].cloud.xyz @ R.T, R)


def _footing(keyframe: Keyframe, points: Array, R: Array) -> float:
    """The footing of an object's points (N, 3) in upright axes ``R (3, 3)``, float32 both."""
    lowest = float(_rim(points[:, 2])[0])
    level = np.ascontiguousarray(points[:, :2].T)
    box = np.array([level.min(axis=1), level.max(axis=1)])
    grown = (box + np.array([[-AROUND], [AROUND]], np.float32)), (box + np.array([[-BESIDE], [BESIDE]], np.float32))
    around = _KERNELS.level(keyframe.context.xyz, keyframe.context.normals, R, *grown, -np.inf, lowest + CLEAR)
    heights = np.sort(around[:, 2])
    within = np.arange(1, len(heights) + 1) - np.searchsorted(heights, heights - STEP, side="right")
    layers = np.flatnonzero(within >= max(SEEN, LAYER * within.max(initial=0)))
    if len(layers) == 0:
        return lowest
    last = int(layers[-1])  # the highest, not the widest: a shelf
    return float(np.median(heights[last + 1 - within[last] : last + 1]))


def _rim(values: Array) -> tuple[float, float]:
    """The 2nd and the 98th percentile of values (N,)."""
    ordered = np.sort(values)
    low, high = np.interp(np.array(RIM) * (len(ordered) - 1), np.arange(len(ordered)), ordered)
    return float(low), float(high)


def upright_pose(source: Shape, target: Shape, motion: Array) -> Array:
    """``T_target_source (..., 4, 4)`` of motions (yaw, x, y, rise) (..., 4) between the upright axes of two origins."""
    c, s = np.cos(motion[..., 0]), np.sin(motion[..., 0])
    turn = np.zeros((*c.shape, 3, 3))
    turn[..., 0, 0], turn[..., 0, 1], turn[..., 1, 0], turn[..., 1, 1], turn[..., 2, 2] = c, -s, s, c, 1.0
    shift = motion[..., 1:] + target.origin - turn @ source.origin
    R_upright_target = target.R_upright_camera
    return pose(R_upright_target.T @ turn @ source.R_upright_camera, shift @ R_upright_target)


def upright_motion(source: Shape, target: Shape, T_target_source: Array) -> Array:
    """(yaw, x, y, rise) (..., 4) of the upright motions nearest to poses (..., 4, 4)."""
    R, t = T_target_source[..., :3, :3], T_target_source[..., :3, 3]
    turn = target.R_upright_camera @ R @ source.R_upright_camera.T
    yaw = np.arctan2(turn[..., 1, 0] - turn[..., 0, 1], turn[..., 0, 0] + turn[..., 1, 1])
    moved = (R @ source.foot + t) @ target.R_upright_camera.T - target.origin
    return np.concatenate([yaw[..., None], moved], axis=-1)


def turned_half(motion: Array, through: Array) -> Array:
    """The motions (K, 4) with the source's shape turned half about its middle, its back so far ``through (K,)`` m.

    Its front lies where its back did, and it is that thick between them, along the line of sight of its camera.
    """
    c, s = np.cos(motion[0]), np.sin(motion[0])
    return np.array([motion + np.array([np.pi, gone * c, gone * s, 0.0]) for gone in through])
