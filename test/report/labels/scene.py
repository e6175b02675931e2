# SPDX-License-Identifier: Apache-2.0
"""A square before a wall, as an object of a map and as a camera sees it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_tools.report.labels.mapped_objects import MappedObject, ObjectView

CAMERA = Intrinsics(fx=300.0, fy=300.0, cx=159.5, cy=119.5, width=320, height=240)
SIDE, NEAR, WALL = 0.2, 1.0, 2.0  # m: the square is 60 px wide and high
BOX = (130, 90, 190, 150)  # of it, px
STEP = 0.004  # m between points
SECOND = 1_000_000_000


def square(
    landmark: int = 1, label: str = "cup", at: tuple[float, float] = (0.0, 0.0), seconds: tuple[float, ...] = (0.0, 1.0)
) -> MappedObject:
    """The square as keyframes at these times saw it, its middle at ``at`` m of the axis of a camera at the origin."""
    x, y = (axis.ravel() for axis in np.meshgrid(*(np.arange(STEP / 2, SIDE, STEP) - SIDE / 2,) * 2))
    xyz = np.column_stack([x + at[0], y + at[1], np.full(x.size, NEAR)])
    normals = np.tile([0.0, 0.0, -1.0], (len(xyz), 1))
    views = tuple(ObjectView(stamp_ns=round(s * SECOND), xyz=xyz, normals=normals, spacing=STEP) for s in seconds)
    return MappedObject(landmark=landmark, label=label, views=views)


def seen(shown: bool = True, stamp_ns: int = 0) -> DepthImage:
    """What the camera at the origin sees: the square before the wall, or the wall alone."""
    depth = np.full((240, 320), WALL, np.float32)
    rgb = np.full((240, 320, 3), 90, np.uint8)
    if shown:
        x_min, y_min, x_max, y_max = BOX
        depth[y_min:y_max, x_min:x_max] = NEAR
        rgb[y_min:y_max, x_min:x_max] = (200, 40, 40)
    return DepthImage(depth=depth, rgb=rgb, intrinsics=CAMERA, stamp_ns=stamp_ns)


class FewPictures:
    """Pictures by time, in place of an album."""

    def __init__(self, images: Mapping[int, DepthImage]) -> None:
        self._images = images

    def at(self, stamp_ns: int) -> DepthImage | None:
        return self._images.get(stamp_ns)
