# SPDX-License-Identifier: Apache-2.0
"""Tests of the grid that knows the closest point."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse
from objreg_ros.registration.kernels.closest_points import NO_POINT, prepare_surface
from objreg_ros.registration.refine.batch_icp import fit
from registration.rooms import keyframe, seen_from

TRUTH = inverse(seen_from(15.0)) @ seen_from(0.0)


@pytest.fixture(scope="module")
def scene():
    source, target = (keyframe(seen_from(a), seed=k).context for k, a in enumerate((0.0, 15.0)))
    return source.xyz[::3], source.normals[::3], prepare_surface(target.xyz, target.normals, 0.05, 0.2)


def test_the_grid_names_the_closest_point() -> None:
    xyz = np.random.default_rng(0).uniform(0, 1, (300, 3)).astype(np.float32)
    surface = prepare_surface(xyz, np.tile(np.float32([0, 0, 1]), (300, 1)), 0.05, 0.2)
    cells = np.argwhere(surface.closest != NO_POINT)[::50]
    centres = surface.low + (cells + 0.5) * surface.cell
    distances = np.linalg.norm(centres[:, None] - xyz[None], axis=2)
    named = surface.closest[tuple(cells.T)]
    assert np.allclose(distances[np.arange(len(cells)), named], distances.min(axis=1), atol=1e-4)


def test_a_surface_without_normals_is_empty_and_fits_nothing(scene) -> None:
    empty = prepare_surface(scene[0], np.zeros_like(scene[0]), 0.05, 0.2)
    assert len(empty) == 0
    assert fit(scene[0], scene[1], empty, np.eye(4), 0.1).inliers == 0


def test_of_more_points_than_two_bytes_number_as_many_stay_evenly() -> None:
    xyz = np.random.default_rng(0).uniform(0, 1, (NO_POINT + 9, 3)).astype(np.float32)
    surface = prepare_surface(xyz, np.tile(np.float32([0, 0, 1]), (len(xyz), 1)), 0.05, 0.2)
    assert len(surface) == NO_POINT and surface.closest.dtype == np.uint16
    assert np.array_equal(surface.xyz[[0, -1]], xyz[[0, -1]])
