# SPDX-License-Identifier: Apache-2.0
"""A painted slab before a painted wall: a view, the slab as an object, and the pixels that show it."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import back_project
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import KeyObject
from objreg_ros.registration.prepare.views import DETAIL_SIGMA_PX, Sight, prepare_sight
from registration.samples import CAMERA, cloud, scene_view

PARAMS = RegistrarParams()


def room(slab_x: float, width: float = 0.9) -> tuple[Sight, KeyObject, Array]:
    """A view of the wall with the slab at ``slab_x``, 1 m away; the slab, and the pixels that show it."""
    view = scene_view()
    ray = back_project(np.ones((120, 160)), CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    x, y = ray[..., 0] - slab_x, ray[..., 1]
    shown = (abs(x) < 0.5 * width) & (abs(y) < 0.35 * width)
    print_of_slab = 128 + 90 * np.sin(40 * x) * np.sin(35 * y)
    print_of_wall = 128 + 600 * cv2.GaussianBlur(np.random.default_rng(5).normal(size=shown.shape), (0, 0), 2.0)
    grey = np.clip(np.where(shown, print_of_slab, print_of_wall), 0, 255).astype(np.uint8)
    xyz = np.where(shown[..., None], ray, view.xyz).astype(np.float32)
    sight = prepare_sight(View(xyz=xyz, grey=grey, intrinsics=CAMERA), PARAMS.context_range, DETAIL_SIGMA_PX)
    return sight, KeyObject(cloud=cloud("monitor", xyz[shown])), shown
