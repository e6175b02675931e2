# SPDX-License-Identifier: Apache-2.0
"""Tests of the fast ICP."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.registration.kernels.closest_points import prepare_surface
from objreg_ros.registration.refine.batch_icp import align, pair
from registration.rooms import keyframe, seen_from

OFF = [
    pose(rotation_from_vector(np.array(r)), np.array(t))
    for r, t in (((0.03, 0.05, 0), (0.05, 0, 0.05)), ((0, 0, 0), (0, 0, 0)))
]
TRUTH = inverse(seen_from(15.0)) @ seen_from(0.0)


@pytest.fixture(scope="module")
def scene():
    source, target = (keyframe(seen_from(a), seed=k).context for k, a in enumerate((0.0, 15.0)))
    return source.xyz[::3], source.normals[::3], prepare_surface(target.xyz, target.normals, 0.05, 0.2)


def test_every_start_falls_into_the_true_basin(scene) -> None:
    poses, share, rmse = align(*scene, np.array([off @ TRUTH for off in OFF]), 0.15, 0.05, 25)
    for T in poses:
        rotation, distance = pose_error(T, TRUTH)
        assert rotation < 0.5 and distance < 1.5
    assert share.min() > 0.5 and rmse.max() < 0.02


def test_no_start_gives_no_pose(scene) -> None:
    poses, share, _ = align(*scene, np.zeros((0, 4, 4)), 0.15, 0.05, 25)
    assert poses.shape == (0, 4, 4) and len(share) == 0


def test_a_start_out_of_reach_stays_and_shares_nothing(scene) -> None:
    away = pose(np.eye(3), np.array([30.0, 0.0, 0.0]))
    poses, share, _ = align(*scene, away[None], 0.15, 0.05, 25)
    assert np.array_equal(poses[0], away) and share[0] == 0.0


def test_pairs_are_near_face_alike_and_have_the_distance_to_the_plane_as_residual(scene) -> None:
    xyz, normals, surface = scene
    index, at, J, residual, weight = pair(xyz, normals, *surface.grid, TRUTH, 0.05)
    moved = xyz[index] @ TRUTH[:3, :3].T + TRUTH[:3, 3]
    assert len(index) > 0.5 * len(xyz) and np.allclose(at.T, moved, atol=1e-5)
    assert np.median(np.abs(residual)) < 0.01 and weight.min() > 0.0 and weight.max() <= 1.0
    assert np.allclose(J[3:].T, np.cross(at.T, J[:3].T))


def test_nothing_pairs_out_of_reach(scene) -> None:
    away = pose(np.eye(3), np.array([30.0, 0.0, 0.0]))
    index, at, J, residual, weight = pair(*scene[:2], *scene[2].grid, away, 0.05)
    assert [part.shape for part in (index, at, J, residual, weight)] == [(0,), (3, 0), (6, 0), (0,), (0,)]
