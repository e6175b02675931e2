# SPDX-License-Identifier: Apache-2.0
"""What a chain says of two keyframes far apart is what its steps say, one after the other."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from objreg_mapper.constraint import Constraint, compensated
from objreg_mapper.optimisation.chain import STRAIGHT_RAD, Chain
from objreg_mapper.optimisation.incremental import load
from objreg_mapper.optimisation.steady import Steady
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector, vector_from_rotation

COUNT = 15
RNG = np.random.default_rng(3)
VARIANCES = np.array([1e-6, 4e-7]) * RNG.uniform(0.5, 2.0, (COUNT - 1, 2))


def winding() -> Array:
    """Poses (n, 4, 4) of a way that turns and climbs, and begins anywhere."""
    poses = [pose(rotation_from_vector(np.array([0.3, -0.4, 1.0])), np.array([3.0, -5.0, 1.0]))]
    for k in range(COUNT - 1):
        turn = np.array([0.05, 0.02 * k - 0.1, 0.3])
        poses.append(poses[-1] @ pose(rotation_from_vector(turn), np.array([0.4, 0.1, 0.05])))
    return np.array(poses)


ODOM = winding()


def chain(steady: Steady = Steady(), variances: Array = VARIANCES) -> Chain:
    made = Chain.begun(ODOM[0], steady).extended(ODOM, variances)
    return made


def steps() -> list[Constraint]:
    motions = [inverse(a) @ b for a, b in pairwise(ODOM)]
    return [Constraint(T, np.diag(np.repeat(v, 3))) for T, v in zip(motions, VARIANCES, strict=True)]


def composed(first: Constraint, second: Constraint) -> Constraint:
    there = compensated(first, np.eye(4), second.T_from_to)
    J = np.kron(np.eye(2), first.T_from_to[:3, :3])
    return Constraint(there.T_from_to, there.covariance + J @ second.covariance @ J.T)


@pytest.mark.parametrize(("k1", "k2"), [(0, 1), (0, 14), (4, 5), (4, 11)])
def test_between_two_keyframes_is_what_the_steps_say_one_after_the_other(k1: int, k2: int) -> None:
    expected = steps()[k1]
    for step in steps()[k1 + 1 : k2]:
        expected = composed(expected, step)
    found = chain().between(k1, k2)
    np.testing.assert_allclose(found.T_from_to, expected.T_from_to, atol=1e-12)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-9, atol=1e-17)


def test_the_covariance_is_how_sampled_ways_differ() -> None:
    said, motions, errors = chain().between(3, 12), [step.T_from_to for step in steps()[3:12]], []
    sigmas = np.sqrt(VARIANCES[3:12])
    for _ in range(4000):
        T = np.eye(4)
        for motion, (metres, radians) in zip(motions, sigmas, strict=True):
            wrong = motion.copy()
            wrong[:3, 3] += metres * RNG.standard_normal(3)
            wrong[:3, :3] = rotation_from_vector(radians * RNG.standard_normal(3)) @ wrong[:3, :3]
            T = T @ wrong
        turn = vector_from_rotation(T[:3, :3] @ said.T_from_to[:3, :3].T)
        errors.append(np.concatenate([T[:3, 3] - said.T_from_to[:3, 3], turn]))
    seen, spread = np.cov(np.array(errors).T), np.sqrt(np.outer(np.diag(said.covariance), np.diag(said.covariance)))
    np.testing.assert_allclose(seen / spread, said.covariance / spread, atol=0.1)


def test_a_chain_that_grows_bit_by_bit_is_the_same() -> None:
    whole, grown = chain(), Chain.begun(ODOM[0], Steady())
    for begin, end in ((0, 1), (1, 1), (1, 9), (9, COUNT - 1)):
        grown = grown.extended(ODOM[begin : end + 1], VARIANCES[begin:end])
    np.testing.assert_allclose(grown.T_chain_body, whole.T_chain_body, atol=1e-12)
    np.testing.assert_allclose(grown.between(2, 13).covariance, whole.between(2, 13).covariance, rtol=1e-9, atol=1e-17)


def test_what_is_steadily_wrong_is_taken_out() -> None:
    straight = np.tile(np.eye(4), (5, 1, 1))
    straight[:, 0, 3] = np.arange(5)
    made = Chain.begun(straight[0], Steady(along=0.1)).extended(straight, np.full((4, 2), 1e-6))
    np.testing.assert_allclose(made.T_chain_body[:, 0, 3], 1.1 * np.arange(5), atol=1e-12)


def bent_end() -> Array:
    """Where the map has the last keyframe: beside where odometry has it, and turned."""
    return ODOM[-1] @ pose(rotation_from_vector(np.array([1e-3, -2e-3, 3e-3])), np.array([4e-3, -3e-3, 2e-3]))


def test_an_error_is_shared_as_a_graph_of_all_keyframes_shares_it() -> None:
    gtsam = load()
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k, T in ((0, ODOM[0]), (COUNT - 1, bent_end())):
        graph.add(gtsam.PriorFactorPose3(k, gtsam.Pose3(T), gtsam.noiseModel.Isotropic.Sigma(6, 1e-9)))
    for k, step in enumerate(steps()):
        sigmas = np.sqrt(np.repeat(VARIANCES[k][::-1], 3))
        noise = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
        graph.add(gtsam.BetweenFactorPose3(k, k + 1, gtsam.Pose3(step.T_from_to), noise))
    for k, T in enumerate(ODOM):
        start.insert(k, gtsam.Pose3(T))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    expected = np.array([solved.atPose3(k).matrix() for k in range(COUNT)])
    found = chain().spread((0, COUNT - 1), np.array([ODOM[0], bent_end()]))
    moved = np.linalg.norm(expected[:, :3, 3] - ODOM[:, :3, 3], axis=1).max()
    assert np.linalg.norm(found[:, :3, 3] - expected[:, :3, 3], axis=1).max() < 0.01 * moved
    for ours, theirs in zip(found, expected, strict=True):
        assert pose_error(ours, theirs)[0] < 0.01 * pose_error(bent_end(), ODOM[-1])[0]


def test_nodes_stay_where_they_are_put_and_what_is_outside_is_carried_along() -> None:
    moved = pose(rotation_from_vector(np.array([0.0, 0.0, 0.4])), np.array([1.0, 2.0, 0.0]))
    nodes, T_map_body = (3, 6, 11), moved @ ODOM[[3, 6, 11]]
    T_map_body[1] = T_map_body[1] @ pose(np.eye(3), np.array([0.01, 0.0, 0.02]))
    found = chain().spread(nodes, T_map_body)
    np.testing.assert_allclose(found[list(nodes)], T_map_body, atol=1e-12)
    np.testing.assert_allclose(found[:3], moved @ ODOM[:3], atol=1e-12)
    np.testing.assert_allclose(found[12:], moved @ ODOM[12:], atol=1e-12)


def test_some_keyframes_are_where_all_of_them_are() -> None:
    T_map_body, wanted = np.array([ODOM[0], bent_end()]), np.array([9, 2, 14, 0])
    whole = chain().spread((0, COUNT - 1), T_map_body)
    np.testing.assert_allclose(chain().spread((0, COUNT - 1), T_map_body, wanted), whole[wanted], atol=1e-12)


def test_few_keyframes_at_once_are_where_all_of_them_are(monkeypatch: pytest.MonkeyPatch) -> None:
    nodes, T_map_body = (0, 6, COUNT - 1), np.array([ODOM[0], ODOM[6], bent_end()])
    whole = chain().spread(nodes, T_map_body)
    monkeypatch.setattr("objreg_mapper.optimisation.chain.AT_ONCE", 4)
    np.testing.assert_array_equal(chain().spread(nodes, T_map_body), whole)


def test_a_map_that_agrees_with_odometry_is_odometry() -> None:
    np.testing.assert_allclose(chain().spread((0, 7, 14), ODOM[[0, 7, 14]]), ODOM, atol=1e-12)


def test_a_chain_is_straight_until_it_may_have_turned_and_for_one_step_at_least() -> None:
    made = chain(variances=np.tile([1e-6, STRAIGHT_RAD**2 / 4.1], (COUNT - 1, 1)))
    assert [made.straight_until(k) for k in (0, 5)] == [4, 9]
    wild = chain(variances=np.tile([1e-6, STRAIGHT_RAD**2 * 9], (COUNT - 1, 1)))
    assert wild.straight_until(5) == 6
    assert chain().straight_until(0) == COUNT - 1
