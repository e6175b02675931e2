# SPDX-License-Identifier: Apache-2.0
"""Tests of how well surfaces hold a pose: the information is that of patches that err together."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros import sensor
from objreg_ros.data.checked import Array
from objreg_ros.registration.certainty import sandwich
from objreg_ros.registration.certainty.sandwich import FREEDOMS, _spread, information, systematic_depth_error_of_step
from objreg_ros.registration.kernels.closest_points import IndexedSurface, prepare_surface


@pytest.fixture(autouse=True)
def even_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Depth that is as noisy far away as near, and small patches."""
    monkeypatch.setattr(sensor, "DEPTH_NOISE_M", 0.002)
    monkeypatch.setattr(sensor, "DEPTH_NOISE_GROWTH", 0.0)
    monkeypatch.setattr(sandwich, "PATCH_M", 0.25)


def corner(step: float) -> tuple[Array, Array]:
    """Three walls of a metre that meet at (0, 0, 2), as points and normals."""
    a, b = (grid.ravel() for grid in np.meshgrid(np.arange(0.05, 1.0, step), np.arange(0.05, 1.0, step)))
    nothing = np.zeros_like(a)
    walls = [(nothing, a, -b), (a, nothing, -b), (a, b, nothing)]
    normals = np.repeat([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)], len(a), axis=0)
    points = np.concatenate([np.stack(wall, axis=1) for wall in walls])
    return points + np.array([0.0, 0.0, 2.0]), normals


def grid_of(xyz: Array, normals: Array) -> IndexedSurface:
    return prepare_surface(xyz.astype(np.float32), normals.astype(np.float32), 0.05, 0.2)


def shifted(errors: Array) -> Array:
    """The information of a corner whose points lie so far off their walls."""
    xyz, normals = corner(0.05)
    moved = (xyz + errors[:, None] * normals).astype(np.float32)
    return information(moved, normals.astype(np.float32), grid_of(xyz, normals), np.eye(4))


def sigma(found: Array) -> Array:
    return np.sqrt(np.diag(np.linalg.inv(found)))


def test_patches_that_err_together_hold_a_pose_less_than_as_much_noise_of_points() -> None:
    xyz, normals = corner(0.05)
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 0.008, len(xyz))
    _, patch = np.unique(np.c_[np.floor(xyz / 0.25), normals], axis=0, return_inverse=True)
    warped = rng.normal(0.0, 0.008, patch.max() + 1)[patch.ravel()]
    ratio = sigma(shifted(warped)) / sigma(shifted(noise))
    assert (ratio > 1.2).all() and ratio.mean() > 1.5


def test_a_perfect_fit_is_as_good_as_the_noise_of_the_camera() -> None:
    xyz, normals = corner(0.05)
    found = shifted(np.zeros(len(xyz)))
    resisting = (normals[:, 0] ** 2).sum() / (2 * 0.002**2)
    assert 0.4 * resisting < found[0, 0] < resisting  # the closest of a cell is not every point's closest


def wall_aside() -> tuple[Array, Array]:
    """A piece of wall that is one patch, as points and normals."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(3.02, 3.22, 21), np.linspace(0.02, 0.22, 21)))
    return np.stack([x, y, np.full_like(x, 4.1)], axis=1), np.tile([0.0, 0.0, -1.0], (len(x), 1))


def ahead_of(xyz: Array) -> Array:
    """How a left step [t r] moves the middle of points along the optical axis."""
    x, y, _ = xyz.mean(axis=0)
    return np.array([0.0, 0.0, 1.0, y, -x, 0.0])


def test_errors_that_cancel_within_a_patch_count_as_noise_of_their_size() -> None:
    xyz, normals = wall_aside()
    turns, flat = np.where(np.arange(len(xyz)) % 2 == 0, 1.0, -1.0), normals.astype(np.float32)
    surface, ahead = grid_of(xyz, normals), ahead_of(xyz)

    def sigma_ahead(error: float) -> float:
        moved = (xyz + error * turns[:, None] * normals).astype(np.float32)
        return float(np.sqrt(ahead @ np.linalg.inv(information(moved, flat, surface, np.eye(4))) @ ahead))

    assert sigma_ahead(0.008) > 2.0 * sigma_ahead(0.0)


def test_few_patches_count_for_more_as_a_pose_follows_six_of_them() -> None:
    J, ones = np.zeros((6, 2 * FREEDOMS)), np.ones(2 * FREEDOMS)
    J[0] = 1.0
    assert _spread(J, ones, np.arange(2 * FREEDOMS))[0, 0] == pytest.approx(2.0 * 2 * FREEDOMS)


def test_what_no_point_resists_is_next_to_unknown() -> None:
    xyz, normals = corner(0.05)
    wall = normals[:, 2] != 0
    found = information(
        xyz[wall].astype(np.float32),
        normals[wall].astype(np.float32),
        grid_of(xyz[wall], normals[wall]),
        np.eye(4),
    )
    assert found[0, 0] < 2.0 and found[1, 1] < 2.0 and found[2, 2] > 1e6


def test_without_partners_nothing_is_known() -> None:
    xyz, normals = (part.astype(np.float32) for part in corner(0.1))
    assert np.array_equal(information(xyz + 5.0, normals, grid_of(xyz, normals), np.eye(4)), np.eye(6))


def worst_shift(xyz: Array, normals: Array, share: float) -> float:
    """How far a camera at the origin may be, by a warp of so much, that sees oriented points."""
    flat = xyz.astype(np.float32), normals.astype(np.float32)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sandwich, "DEPTH_WARP", share)
        C = systematic_depth_error_of_step(*flat, grid_of(xyz, normals), np.eye(4))
    return float(np.sqrt(np.linalg.eigvalsh(C[:3, :3])[-1]))


def test_a_warped_depth_makes_a_pose_as_wrong_as_it_is_warped() -> None:
    assert worst_shift(*corner(0.05), 0.02) == pytest.approx(2.0 * worst_shift(*corner(0.05), 0.01), rel=0.01)


def test_a_warped_depth_turns_a_camera_more_about_a_small_thing_than_about_a_large_one() -> None:
    xyz, normals = corner(0.05)
    near_the_corner = np.linalg.norm(xyz - np.array([0.0, 0.0, 2.0]), axis=1) < 0.45
    assert worst_shift(xyz[near_the_corner], normals[near_the_corner], 0.01) > 1.5 * worst_shift(xyz, normals, 0.01)


def test_a_patch_aside_may_lie_off_by_the_share_of_its_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sandwich, "DEPTH_WARP", 0.01)
    xyz, normals = wall_aside()
    flat = xyz.astype(np.float32), normals.astype(np.float32)
    C = systematic_depth_error_of_step(*flat, grid_of(xyz, normals), np.eye(4))
    ahead = ahead_of(xyz)
    assert np.sqrt(ahead @ C @ ahead) == pytest.approx(0.01 * np.linalg.norm(xyz.mean(axis=0)), rel=0.02)


def test_a_camera_with_twice_the_noise_knows_a_pose_half_as_well_and_a_quiet_one_no_better() -> None:
    xyz, normals = (part.astype(np.float32) for part in corner(0.05))
    surface = grid_of(xyz, normals)
    sigmas = [sigma(information(xyz, normals, surface, np.eye(4), (noise, noise))) for noise in (0.3, 1.0, 2.0)]
    assert np.allclose(sigmas[0], sigmas[1]) and np.allclose(sigmas[2], 2.0 * sigmas[1], rtol=0.01)
