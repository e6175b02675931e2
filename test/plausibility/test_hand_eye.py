# SPDX-License-Identifier: Apache-2.0
"""Where a camera sits on a body, by the motions of both."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, pose_error, rotation_from_vector
from objreg_ros.plausibility.hand_eye import best_rotation, hand_eye, scale_of, turns_of
from plausibility.moving import MOUNT, carried, level_motions, random_motions

FREE = random_motions(24, turn=0.25, shift_m=0.15)


def noisy(vectors: Array, sigma: float, seed: int = 3) -> Array:
    return vectors + np.random.default_rng(seed).normal(0, sigma, vectors.shape)


def jolted(T: Array, seed: int = 4) -> Array:
    """Motions that err by half a degree and 5 mm."""
    rng = np.random.default_rng(seed)
    return T @ pose(rotation_from_vector(rng.normal(0, 0.005, (len(T), 3))), rng.normal(0, 0.005, (len(T), 3)))


def test_turns_are_rotation_vectors() -> None:
    vectors = np.array([[0.1, -0.2, 0.3], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(turns_of(pose(rotation_from_vector(vectors), np.zeros((2, 3)))), vectors, atol=1e-12)


def test_the_rotation_between_directions_is_found_beside_a_few_that_are_wrong() -> None:
    sources = np.random.default_rng(1).normal(size=(30, 3))
    targets = sources @ MOUNT[:3, :3].T
    targets[:5] = np.random.default_rng(2).normal(size=(5, 3))
    np.testing.assert_allclose(best_rotation(targets, sources), MOUNT[:3, :3], atol=1e-9)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.0, 2.5, 0.0), (1.5, 1.5, -1.5)])
def test_a_known_mount_is_recovered_wherever_it_looks(turn: tuple[float, float, float]) -> None:
    mount = MOUNT @ pose(rotation_from_vector(np.array(turn)), np.zeros(3))
    found = hand_eye(FREE, carried(FREE, mount))
    degrees, centimetres = pose_error(found.T_body_camera, mount)
    assert degrees < 0.1 and centimetres < 0.5 and found.rest < 0.05
    assert found.scale == pytest.approx(1.0, abs=1e-3)


def test_a_mount_is_recovered_within_its_deviation_under_noise() -> None:
    found = hand_eye(jolted(FREE), jolted(carried(FREE), seed=5))
    degrees, _ = pose_error(found.T_body_camera, MOUNT)
    off = np.abs(found.T_body_camera[:3, 3] - MOUNT[:3, 3])
    assert degrees < 3.0 * found.rotation_sigma_deg < 6.0
    assert (off < 3.0 * found.lever_sigma_m).all() and found.lever_sigma_m.max() < 0.1


def test_a_level_robot_leaves_the_height_of_its_camera_open() -> None:
    level = level_motions(24)
    found = hand_eye(level, carried(level))
    x, y, height = found.lever_sigma_m
    assert height > 0.4 and max(x, y) < 0.1
    assert abs(found.T_body_camera[2, 3]) < 0.01, "what is open stays near zero"
    np.testing.assert_allclose(found.T_body_camera[:2, 3], MOUNT[:2, 3], atol=0.01)
    assert pose_error(found.T_body_camera, MOUNT)[0] < 0.5


@pytest.mark.parametrize("scale", [0.5, 1.0, 1.3])
def test_the_scale_is_measured_with_the_mount_and_by_a_mount_that_is_known(scale: float) -> None:
    T_camera = carried(FREE, scale=scale)
    assert hand_eye(FREE, T_camera).scale == pytest.approx(scale, rel=0.01)
    known = hand_eye(FREE, T_camera, MOUNT)
    assert known.scale == pytest.approx(scale, rel=1e-3) and known.scale_sigma < 0.025
    assert known.T_body_camera is MOUNT and known.rotation_sigma_deg == 0.0 and not known.lever_sigma_m.any()


def test_motions_of_two_bodies_leave_more_than_those_of_one() -> None:
    of_another = carried(random_motions(24, seed=9, turn=0.25, shift_m=0.15))
    assert hand_eye(FREE, of_another).rest > 1.0 > hand_eye(jolted(FREE), carried(FREE)).rest


def test_a_scale_under_noise_lies_between_both_regressions() -> None:
    true = np.random.default_rng(2).normal(0, 0.1, (60, 3))
    shifts, others = noisy(1.2 * true, 0.05), noisy(true, 0.05, seed=4)
    diluted = np.sum(shifts * others) / np.sum(others**2)
    lengthened = np.sum(shifts**2) / np.sum(shifts * others)
    found = scale_of(shifts, others)
    assert diluted < found.factor < lengthened
    assert abs(np.log(found.factor / 1.2)) < found.sigma
    assert found.sigma > 0.4 * np.log(lengthened / diluted), "no surer than they agree"


def test_a_scale_turned_about_is_its_inverse() -> None:
    true = np.random.default_rng(2).normal(0, 0.1, (60, 3))
    shifts, others = noisy(1.2 * true, 0.02), noisy(true, 0.02, seed=4)
    assert scale_of(shifts, others).factor * scale_of(others, shifts).factor == pytest.approx(1.0, abs=1e-6)


def test_the_deviation_of_a_scale_grows_with_the_noise() -> None:
    true = np.random.default_rng(2).normal(0, 0.1, (60, 3))
    sigmas = [scale_of(noisy(true, noise), noisy(true, noise, seed=4)).sigma for noise in (0.0, 0.02, 0.05, 0.1)]
    assert sigmas == sorted(sigmas) and sigmas[0] < 0.03 and sigmas[-1] > 3.0 * sigmas[0]
