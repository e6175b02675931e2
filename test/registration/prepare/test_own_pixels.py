# SPDX-License-Identifier: Apache-2.0
"""Tests of where a view shows an object."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data import Array, View
from objreg_ros.geometry import back_project
from objreg_ros.registration.keyframe import KeyObject
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.prepare.views import Sight, own_pixels, prepare_sight
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
    sight = prepare_sight(View(xyz=xyz, grey=grey, intrinsics=CAMERA), PARAMS.context_range, PARAMS.detail_sigma)
    return sight, KeyObject(cloud=cloud("monitor", xyz[shown])), shown


def test_an_object_is_found_where_a_view_shows_it_with_its_rim_and_no_more() -> None:
    sight, item, shown = room(0.1)
    own = own_pixels(item, sight)
    assert own[shown].all() and own.sum() < 1.15 * shown.sum()


def test_what_stands_before_or_behind_an_object_is_not_it() -> None:
    sight, item, shown = room(0.1)
    for gone in (-0.2, 0.2):
        moved_away = KeyObject(cloud=cloud("monitor", item.cloud.xyz * np.float32(1.0 + gone)))
        assert not own_pixels(moved_away, sight)[shown & (sight.near == sight.far)].any()
