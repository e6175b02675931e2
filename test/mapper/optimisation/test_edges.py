# SPDX-License-Identifier: Apache-2.0
"""How far poses are from what edges say, and how that changes."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.constraint import Constraint, local_information, rotation_first
from objreg_mapper.optimisation.edges import edges_of, squared_residuals, whitened_errors
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector

RNG = np.random.default_rng(11)


def random_pose(size: float = 1.0) -> Array:
    return pose(rotation_from_vector(size * RNG.normal(size=3)), size * RNG.normal(size=3))


def random_constraint(T: Array) -> Constraint:
    A = 0.1 * RNG.normal(size=(6, 6))
    return Constraint(T, A @ A.T + 1e-3 * np.eye(6))


POSES = np.array([random_pose() for _ in range(3)])
SAID = [(0, 1, random_constraint(inverse(POSES[0]) @ POSES[1])), (2, 0, random_constraint(random_pose()))]


def test_an_edge_that_poses_keep_has_no_error() -> None:
    errors = whitened_errors(POSES, edges_of(SAID))
    np.testing.assert_allclose(errors[0], 0.0, atol=1e-9)
    assert np.linalg.norm(errors[1]) > 1.0


def test_the_square_of_a_whitening_is_the_information_rotation_first() -> None:
    for (_, _, constraint), W in zip(SAID, edges_of(SAID).whitening, strict=True):
        np.testing.assert_allclose(W.T @ W, rotation_first(local_information(constraint)), rtol=1e-5)


@pytest.mark.parametrize(("axis", "sigma"), [(0, 0.1), (2, 0.1), (4, 0.02)])
def test_a_residual_counts_standard_deviations(axis: int, sigma: float) -> None:
    error = np.zeros(6)
    error[axis] = 3.0 * sigma
    T = pose(rotation_from_vector(error[3:]), error[:3])
    said = Constraint(np.eye(4), np.diag(np.square([0.1, 0.1, 0.1, 0.02, 0.02, 0.02])))
    found = squared_residuals(np.array([np.eye(4), T]), edges_of([(0, 1, said)]))
    assert found == pytest.approx([9.0])


def test_a_residual_is_that_of_the_constraint_s_covariance_in_the_axes_of_from() -> None:
    """What a small error [t r] of ROS costs by the covariance itself."""
    said, error = SAID[0][2], 1e-6 * RNG.normal(size=6)
    T_1_2 = pose(rotation_from_vector(error[3:]) @ said.T_from_to[:3, :3], said.T_from_to[:3, 3] + error[:3])
    found = squared_residuals(np.array([np.eye(4), T_1_2]), edges_of([(0, 1, said)]))
    assert found == pytest.approx([error @ np.linalg.solve(said.covariance, error)], rel=1e-4)


def test_a_choice_of_edges_and_those_that_join_them_keep_their_order() -> None:
    both = edges_of(SAID)
    first, second = both.taken(slice(0, 1)), both.taken(np.array([False, True]))
    again = second.joined(first)
    assert len(again) == 2 and again.k1.tolist() == [2, 0] and again.k2.tolist() == [0, 1]
    np.testing.assert_array_equal(again.T_1_2, both.T_1_2[::-1])
    np.testing.assert_array_equal(again.whitening, both.whitening[::-1])


def test_no_edges_are_edges_too() -> None:
    none = edges_of(())
    assert len(none) == 0 and squared_residuals(POSES, none).shape == (0,)
    assert len(none.joined(edges_of(SAID))) == 2
