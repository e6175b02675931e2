# SPDX-License-Identifier: Apache-2.0
"""Open3D's optimiser against answers that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector, vector_from_rotation
from objreg_ros.mapper.constraint import Constraint, local_information, open3d_information
from objreg_ros.mapper.optimisation import Edge, _stages, optimise, squared_residual


def translation(x: float, y: float = 0.0) -> Array:
    return pose(np.eye(3), np.array([x, y, 0.0]))


def edge(target: int, source: int, T: Array, sigma: float = 0.1, uncertain: bool = False) -> Edge:
    return Edge(target, source, T, np.eye(6) / sigma**2, uncertain)


def test_two_measurements_meet_where_their_information_says() -> None:
    """The weighted optimum of two conflicting poses far from the identity: it tells the frame of the information."""
    rng = np.random.default_rng(0)
    T_first = pose(rotation_from_vector(np.array([0.4, -1.1, 0.9])), np.array([1.0, -2.0, 0.5]))
    T_second = T_first @ pose(rotation_from_vector(0.01 * rng.normal(size=3)), 0.01 * rng.normal(size=3))
    spreads = [rng.normal(size=(6, 6)) for _ in range(2)]
    constraints = [
        Constraint(T, 1e-4 * (A @ A.T + np.eye(6))) for T, A in zip((T_first, T_second), spreads, strict=True)
    ]
    edges = [Edge(0, 1, c.T_from_to, open3d_information(c), False) for c in constraints]

    def residuals(x: Array) -> Array:
        T = pose(T_first[:3, :3] @ rotation_from_vector(x[3:]), T_first[:3, 3] + x[:3])
        return np.concatenate([whitened(T, c) for c in constraints])

    def whitened(T: Array, c: Constraint) -> Array:
        error = inverse(c.T_from_to) @ T
        e = np.concatenate([error[:3, 3], vector_from_rotation(error[:3, :3])])
        return np.linalg.cholesky(local_information(c)).T @ e

    x = least_squares(residuals, np.zeros(6), xtol=1e-14).x
    poses = optimise([np.eye(4), T_first], edges, max_residual=5.0).poses
    T = inverse(poses[0]) @ poses[1]
    np.testing.assert_allclose(T[:3, 3], T_first[:3, 3] + x[:3], atol=2e-5)
    np.testing.assert_allclose(T[:3, :3], T_first[:3, :3] @ rotation_from_vector(x[3:]), atol=2e-5)


def test_the_first_node_stays() -> None:
    start = translation(3.0, 4.0)
    solution = optimise([start, np.eye(4)], [edge(0, 1, translation(1.0))], max_residual=5.0)
    np.testing.assert_allclose(solution.poses[0], start, atol=1e-9)
    np.testing.assert_allclose(solution.poses[1], translation(4.0, 4.0), atol=1e-6)


def test_stages_come_down_fourfold_from_the_largest_residual_that_may_be_pruned_to_the_wanted_one() -> None:
    poses = [np.eye(4), translation(1.0)]
    said = [edge(0, 1, translation(1.0 + 0.1 * np.sqrt(r)), uncertain=r < 1e3) for r in (1.0, 40.0, 1e4)]
    assert _stages(poses, said, 4.0) == [64.0, 16.0, 4.0]
    assert _stages(poses, said[::2], 4.0) == [4.0]


def test_a_residual_counts_standard_deviations() -> None:
    poses = [np.eye(4), translation(1.3)]
    assert squared_residual(poses, edge(0, 1, translation(1.0), sigma=0.1)) == pytest.approx(9.0)


def chain(count: int = 6) -> tuple[list[Array], list[Edge]]:
    poses = [translation(float(k)) for k in range(count)]
    return poses, [edge(k, k + 1, translation(1.0)) for k in range(count - 1)]


def test_an_edge_beyond_the_limit_is_pruned_and_leaves_no_trace() -> None:
    poses, edges = chain()
    solution = optimise(poses, [*edges, edge(0, 5, translation(5.0, 3.0), uncertain=True)], max_residual=5.0)
    assert solution.kept == (True,) * 5 + (False,)
    for found, expected in zip(solution.poses, poses, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_an_edge_within_the_limit_is_kept_and_shares_the_error() -> None:
    poses, edges = chain()
    solution = optimise(poses, [*edges, edge(0, 5, translation(5.0, 0.3), uncertain=True)], max_residual=5.0)
    assert all(solution.kept)
    assert 0.05 < solution.poses[5][1, 3] < 0.3


@pytest.mark.parametrize(("sigmas", "kept"), [(4.5, True), (5.5, False)])
def test_an_edge_is_kept_up_to_the_limit_in_its_standard_deviations(sigmas: float, kept: bool) -> None:
    sure = edge(0, 1, translation(1.0), sigma=1e-3)
    off = edge(0, 1, translation(1.0, 0.1 * sigmas), sigma=0.1, uncertain=True)
    assert optimise([np.eye(4), translation(1.0)], [sure, off], max_residual=5.0).kept == (True, kept)


def test_right_edges_that_begin_far_off_are_kept() -> None:
    """Odometry that turned all along: its two ends are metres apart, and nothing but the closures says so."""
    turn = pose(rotation_from_vector(np.array([0.0, 0.0, 0.1])), np.array([1.0, 0.0, 0.0]))
    poses = [np.eye(4)]
    for _ in range(20):
        poses.append(poses[-1] @ turn)
    spread = np.diag([0.05**-2] * 3 + [0.05**-2] * 3)
    steps = [Edge(k, k + 1, turn, spread, False) for k in range(20)]
    sure = np.eye(6) / 0.02**2
    straight = [Edge(k, k + 10, translation(10.0), sure, True) for k in range(11)]
    solution = optimise(poses, [*steps, *straight], max_residual=5.0)
    assert all(solution.kept)
    assert np.linalg.norm(solution.poses[-1][:3, 3] - (20.0, 0.0, 0.0)) < 0.5 * np.linalg.norm(
        poses[-1][:3, 3] - (20.0, 0.0, 0.0)
    )
