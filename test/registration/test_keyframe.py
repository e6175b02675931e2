# SPDX-License-Identifier: Apache-2.0
"""Keyframe and its parts."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.frames import ObjectCloud
from objreg_ros.registration.keyframe import KeyObject


def _cloud(xyz: np.ndarray) -> ObjectCloud:
    points = xyz.astype(np.float32)
    flags = np.zeros(len(points), np.uint16)
    return ObjectCloud(
        label="cup", score=0.9, instance=1, xyz=points, normals=0 * points, rgb=None, flags=flags, density=1e4
    )


def test_the_centroid_of_an_object_does_not_lean_to_where_it_was_sampled_more() -> None:
    ends = np.array([[0.0, 0, 1]] * 90 + [[0.2, 0, 1]] * 10)
    assert np.allclose(KeyObject(cloud=_cloud(ends)).centroid, (0.1, 0, 1))
