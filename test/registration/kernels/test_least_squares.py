# SPDX-License-Identifier: Apache-2.0
"""Tests of normal equations."""

from __future__ import annotations

import numpy as np

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registration.kernels.least_squares import add_normal_equations, move, solve


def test_the_solution_of_a_positive_definite_system_is_that_of_numpy() -> None:
    J = np.random.default_rng(1).normal(size=(9, 6))
    A, b = J.T @ J, np.arange(6.0)
    x = b.copy()
    solve(A.copy(), x)
    assert np.allclose(x, np.linalg.solve(A, b))


def test_a_step_moves_a_pose_as_its_rotation_and_translation_do() -> None:
    T = pose(rotation_from_vector(np.array([0.3, -0.2, 0.1])), np.array([1.0, 2.0, 3.0]))
    step = np.array([0.1, -0.2, 0.05, 0.02, 0.3, -0.1])
    wanted = pose(rotation_from_vector(step[3:]), step[:3]) @ T
    assert move(T, step) == 0.3
    assert np.allclose(T, wanted)


def test_normal_equations_are_weighed_and_added_to_what_is_there() -> None:
    rng = np.random.default_rng(2)
    J, error, weight = rng.normal(size=(6, 20)), rng.normal(size=20), rng.uniform(0.1, 2.0, 20)
    H, g = np.eye(6), np.ones(6)
    add_normal_equations(J, error, weight, H, g)
    assert np.allclose(H, np.eye(6) + (J * weight) @ J.T) and np.allclose(g, 1.0 + J @ (weight * error))
