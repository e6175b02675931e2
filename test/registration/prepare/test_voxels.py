# SPDX-License-Identifier: Apache-2.0
"""Tests of thinning."""

from __future__ import annotations

import numpy as np

from objreg_ros.registration.prepare.voxels import thin


def test_thinning_gives_the_mean_of_each_voxel_with_normals_of_length_1() -> None:
    xyz = np.float32([[0.01, 0.01, 1.01], [0.03, 0.01, 1.01], [0.26, 0.01, 1.01]])
    normals = np.float32([[0, 0, -1], [0, -1, 0], [1, 0, 0]])
    mean, direction = thin(xyz, normals, 0.05)
    assert np.allclose(mean, [[0.02, 0.01, 1.01], [0.26, 0.01, 1.01]])
    assert np.allclose(direction, [[0, -(0.5**0.5), -(0.5**0.5)], [1, 0, 0]])
