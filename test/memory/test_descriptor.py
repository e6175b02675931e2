# SPDX-License-Identifier: Apache-2.0
"""Descriptors: alike for one object from anywhere, unlike for others."""

from __future__ import annotations

import numpy as np
from registration.samples import box, cloud

from objreg_ros.geometry import pose, rotation_from_vector, transform
from objreg_ros.memory.descriptor import SIZE, describe


def test_a_descriptor_does_not_depend_on_where_the_object_is() -> None:
    item = box("cup", (0, 0, 1), 0.1)
    T = pose(rotation_from_vector(np.array([0.4, 1.0, -0.3])), np.array([0.5, -0.2, 0.7]))
    other = cloud("cup", transform(T, item.xyz), rgb=item.rgb)
    assert describe(item).shape == (SIZE,)
    assert np.linalg.norm(describe(item) - describe(other)) < 0.05


def test_size_and_colour_distinguish_objects() -> None:
    small, large = box("box", (0, 0, 1), 0.1), box("box", (0, 0, 1), 0.3)
    red = cloud("box", small.xyz, rgb=np.tile(np.uint8([200, 20, 20]), (len(small), 1)))
    blue = cloud("box", small.xyz, rgb=np.tile(np.uint8([20, 20, 200]), (len(small), 1)))
    assert np.linalg.norm(describe(small) - describe(large)) > 0.8
    assert np.linalg.norm(describe(red) - describe(blue)) > 0.8


def test_a_cloud_of_one_point_or_without_colour_has_a_descriptor() -> None:
    assert np.isfinite(describe(cloud("cup", np.array([[0.0, 0, 1]])))).all()
    assert np.isfinite(describe(cloud("cup", np.zeros((5, 3)), rgb=np.zeros((5, 3), np.uint8)))).all()
