# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, inverses, pose, pose_error, rotation_from_vector
from objreg_ros.plausibility.hand_eye import best_rotation, hand_eye, scale_of
from plausibility.spans import path

MOUNT = pose(rotation_from_vector(np.array([1.2, -1.1, 1.3])), np.array([0.2, -0.1, 0.3]))


def motions(T_world_camera: Array, T_body_camera: Array, scale: float = 1.0) -> tuple[Array, Array]:
    """The motions of the body and of its camera, whose metres are ``scale`` times too long."""
    T_body = T_world_camera @ inverse(T_body_camera)
    of_body, of_camera = (inverses(T[:-1]) @ T[1:] for T in (T_body, T_world_camera))
    of_camera[:, :3, 3] *= scale
    return of_body, of_camera


def level_path(count: int) -> Array:
    """``T_world_body`` of a robot that turns about the vertical and drives ahead."""
    T, rng = [np.eye(4)], np.random.default_rng(5)
    for _ in range(count - 1):
        turn = np.array([0.0, 0.0, rng.uniform(-0.4, 0.4)])
        T.append(T[-1] @ pose(rotation_from_vector(turn), np.array([rng.uniform(0.1, 0.3), 0.0, 0.0])))
    return np.array(T)


def test_the_mount_of_a_camera_is_found_by_its_motions() -> None:
    found = hand_eye(*motions(path(25), MOUNT))
    degrees, centimetres = pose_error(found.T_body_camera, MOUNT)
    assert degrees < 1.0 and centimetres < 3.0 and abs(np.log(found.scale)) < 0.02 and found.rest < 0.5


def test_a_level_robot_leaves_the_height_of_its_camera_open_and_says_so() -> None:
    found = hand_eye(*motions(level_path(25) @ MOUNT, MOUNT))
    degrees, _ = pose_error(found.T_body_camera, MOUNT)
    assert degrees < 2.0 and found.lever_sigma_m[2] > 0.3 and (found.lever_sigma_m[:2] < 0.1).all()


def test_depth_that_is_too_long_shows_in_the_scale_under_a_known_mount_and_under_none() -> None:
    moved = motions(path(25), MOUNT, scale=1.3)
    for found in (hand_eye(*moved, MOUNT), hand_eye(*moved)):
        assert abs(np.log(found.scale / 1.3)) < 2 * found.scale_sigma < 0.2
    assert (hand_eye(*moved, MOUNT).T_body_camera == MOUNT).all()


def test_noise_of_either_shift_does_not_make_a_scale_but_its_deviation() -> None:
    rng = np.random.default_rng(7)
    true = 0.02 * rng.standard_normal((60, 3))
    noisy = true + 0.02 * rng.standard_normal((60, 3))
    for shifts, others in ((noisy, true), (true, noisy)):
        found = scale_of(shifts, others)
        assert abs(np.log(found.factor)) < 2 * found.sigma and found.sigma > 0.2
    exact = scale_of(2.0 * true, true)
    assert abs(exact.factor - 2.0) < 0.05 and exact.sigma < 0.05 and exact.rest < 0.1


def test_the_rotation_between_directions_leaves_out_what_is_far_off() -> None:
    sources = np.random.default_rng(8).standard_normal((30, 3))
    targets = sources @ MOUNT[:3, :3].T
    targets[:3] *= -1.0
    np.testing.assert_allclose(best_rotation(targets, sources), MOUNT[:3, :3], atol=1e-9)
