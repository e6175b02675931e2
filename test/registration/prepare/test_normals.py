# SPDX-License-Identifier: Apache-2.0
"""Tests of the normals of a view."""

from __future__ import annotations

import numpy as np

from objreg_ros.registration.prepare.normals import view_normals
from registration.samples import scene_view


def test_normals_face_the_camera_and_are_unknown_beside_a_jump() -> None:
    xyz = scene_view().xyz.copy()
    xyz[:, :80] *= 0.5
    normals = view_normals(xyz)
    assert np.allclose(np.linalg.norm(normals[10:50, 100:150], axis=-1), 1, atol=1e-5)
    assert (normals * xyz).sum(axis=-1).max() <= 0
    assert not normals[:, 79:81].any()
