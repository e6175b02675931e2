# SPDX-License-Identifier: Apache-2.0
"""Depth of one camera as another camera would have measured it: each pixel is moved, and the nearest of a place wins.

A depth pixel covers the part of the other picture that its square covers there, and reaches on to its neighbours on
the same surface. So no holes open where the other picture is finer or sees a surface from another side, and nothing
behind shines through. What only the other camera sees stays without depth.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import inverse
from objreg_ros.native import kernels

_KERNELS = kernels("registered_depth")
HARDLY_FINER = 1.25  # times the resolution of depth: such a picture is left as it is
SHOWN_AT_M = (0.5, 5.0)  # a place is in the depth camera's picture where it is so at both distances

Key = tuple[float, ...]


def camera_for(picture: Intrinsics, depth: Intrinsics) -> Intrinsics:
    """The camera of a colour picture, scaled down to about the angle that a pixel of depth has.

    A finer one would hold no more depth, and every later step costs by the pixel. A coarser one is left as it is.
    """
    finer = min(picture.fx / depth.fx, picture.fy / depth.fy)
    if finer <= HARDLY_FINER:
        return picture
    width, height = (max(1, round(side / finer)) for side in (picture.width, picture.height))
    across, down = width / picture.width, height / picture.height
    return Intrinsics(
        fx=picture.fx * across,
        fy=picture.fy * down,
        cx=(picture.cx + 0.5) * across - 0.5,
        cy=(picture.cy + 0.5) * down - 0.5,
        width=width,
        height=height,
    )


def register(
    depth: DepthImage, T_colour_depth: Array, picture: Intrinsics, rgb: Array | None = None, frame_id: str = ""
) -> DepthImage:
    """The depth image in the camera of a colour picture, or in that camera scaled down by `camera_for`.

    ``T_colour_depth (4, 4)`` maps points of depth's optical frame into colour's; ``rgb (H, W, 3)`` is the picture of
    ``picture``, ``frame_id`` its frame. Depth is along the optical axis of colour, m, and 0 where the depth camera
    measured nothing or does not see. ValueError where depth was measured and none of it is in the picture.
    """
    camera = camera_for(picture, depth.intrinsics)
    metres = moved(depth.depth, depth.intrinsics, T_colour_depth, camera)
    if not metres.any() and depth.depth.any():
        where = " ".join(f"{value:.3f}" for value in T_colour_depth[:3, 3])
        raise ValueError(
            f"depth: expected some of it in the picture of colour, got none with depth at {where} m in {frame_id!r}; "
            "is /tf_static between the two frames, and the camera_info of both, right?"
        )
    if rgb is not None and rgb.shape[:2] != metres.shape:
        rgb = np.asarray(cv2.resize(rgb, (camera.width, camera.height), interpolation=cv2.INTER_AREA))
    return DepthImage(
        depth=metres,
        rgb=rgb,
        intrinsics=camera,
        stamp_ns=depth.stamp_ns,
        frame_id=frame_id or depth.frame_id,
        shown=_shown(depth, T_colour_depth, camera),
    )


def moved(depth: Array, of: Intrinsics, T_to_of: Array, to: Intrinsics) -> Array:
    """Depth (H, W) float32 m of camera ``of`` as camera ``to`` has it (h, w), 0 where there is none."""
    R, t = T_to_of[:3, :3], T_to_of[:3, 3].astype(np.float32)
    across = (R[:, :1] * ((np.arange(of.width) - of.cx) / of.fx)).astype(np.float32)
    down = (R[:, 1:2] * ((np.arange(of.height) - of.cy) / of.fy) + R[:, 2:]).astype(np.float32)
    K = np.array([to.fx, to.fy, to.cx, to.cy], np.float32)
    steps = (R[:, :2] / [of.fx, of.fy]).astype(np.float32)
    depth, uvz = np.ascontiguousarray(depth), np.empty((*depth.shape, 3), np.float32)
    _KERNELS.project(depth, across, down, t, K, uvz)
    found = np.full((to.height, to.width), np.inf, np.float32)
    _KERNELS.splat(depth, uvz, steps, K, found)
    found[np.isinf(found)] = 0.0
    return found


def _shown(depth: DepthImage, T_colour_depth: Array, camera: Intrinsics) -> Array | None:
    """(h, w) bool: which pixels the depth camera's picture reaches; None where that is all of them."""
    rows, columns, inside = _seen_from(_key(depth.intrinsics), _key(camera), tuple(T_colour_depth.ravel().tolist()))
    if depth.shown is not None:
        inside = inside & depth.shown[rows, columns]
    return None if inside.all() else inside


@lru_cache(maxsize=2)
def _seen_from(depth: Key, camera: Key, T: Key) -> tuple[Array, Array, Array]:
    """The rows and columns (h, w) of depth that show the far pixels of colour, and which pixels it shows at all."""
    T_depth_colour = inverse(np.array(T).reshape(4, 4))
    fx, fy, cx, cy, width, height = camera
    u, v = np.meshgrid(np.arange(int(width)), np.arange(int(height)))
    rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(u.shape)], axis=-1) @ T_depth_colour[:3, :3].T
    fx, fy, cx, cy, width, height = depth
    inside = np.ones(u.shape, np.bool_)
    for distance in SHOWN_AT_M:
        x, y, z = np.moveaxis(rays * distance + T_depth_colour[:3, 3], -1, 0)
        ahead = np.maximum(z, 1e-6)
        columns, rows = np.rint(fx * x / ahead + cx), np.rint(fy * y / ahead + cy)
        inside &= (z > 0) & (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
    bounded = (np.clip(values, 0, most - 1).astype(np.int32) for values, most in ((rows, height), (columns, width)))
    return *bounded, inside


def _key(camera: Intrinsics) -> Key:
    return camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height
