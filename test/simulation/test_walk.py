# SPDX-License-Identifier: Apache-2.0
"""A walk has the truth, odometry that drifts from it as it should, and as many lies as it should."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose_error, vector_from_rotation
from objreg_tools.simulation.walk import APART, LEAST_SIGMA, NEAR_M, PERIOD_NS, Walk, WalkParams, walk

PLAIN = WalkParams()
LYING = WalkParams(false_share=0.2, agreeing_share=0.1)


def error(of: Walk, closure: LoopClosure) -> np.ndarray:
    """What a closure says beside the truth, (4, 4) in the axes of *to*."""
    a, b = (of.T_world_body[stamp // PERIOD_NS] for stamp in (closure.from_ns, closure.to_ns))
    return inverse(inverse(a) @ b) @ closure.T_from_to


def lies(of: Walk) -> list[LoopClosure]:
    return [closure for closure, is_false in zip(of.closures, of.is_false, strict=True) if is_false]


def test_a_seed_is_a_walk_and_another_is_another() -> None:
    one, again, other = walk(LYING, 3), walk(LYING, 3), walk(LYING, 4)
    np.testing.assert_array_equal(one.T_world_body, again.T_world_body)
    for ours, theirs in zip(one.closures, again.closures, strict=True):
        np.testing.assert_array_equal(ours.T_from_to, theirs.T_from_to)
    assert not np.array_equal(one.T_world_body, other.T_world_body)


def test_the_right_closures_are_the_same_whatever_the_share_of_false_ones() -> None:
    clean, lying = walk(PLAIN, 5), walk(LYING, 5)
    assert len(clean.right_closures) == len(lying.right_closures) == len(clean.closures)
    for ours, theirs in zip(clean.right_closures, lying.right_closures, strict=True):
        np.testing.assert_array_equal(ours.T_from_to, theirs.T_from_to)


def test_a_body_goes_through_corridors_by_steps_of_one_length() -> None:
    of = walk(PLAIN, 1)
    steps = np.linalg.norm(np.diff(of.T_world_body[:, :3, 3], axis=0), axis=1)
    assert len(of.T_world_body) == PLAIN.poses
    np.testing.assert_allclose(steps, PLAIN.step_m, atol=1e-9)
    on_line = np.abs(of.T_world_body[:, :2, 3] / PLAIN.corridor_m % 1.0)
    assert (np.minimum(on_line, 1.0 - on_line).min(axis=1) < 1e-9).all()
    assert of.T_world_body[:, :2, 3].max() <= PLAIN.corridor_m * PLAIN.corridors


def test_odometry_wanders_step_by_step_as_its_sigmas_say() -> None:
    of = walk(WalkParams(poses=4000, drift_m=0.03, drift_deg=2.0), 0)
    errors = []
    poses = [sample.T_odom_body for sample in of.odometry]
    for (a, b), (true_a, true_b) in zip(pairwise(poses), pairwise(of.T_world_body), strict=True):
        motion, true = inverse(a) @ b, inverse(true_a) @ true_b
        way = np.linalg.norm(true[:3, 3]) + np.linalg.norm(vector_from_rotation(true[:3, :3]))
        wrong = inverse(true) @ motion
        errors.append(np.concatenate([wrong[:3, 3], vector_from_rotation(wrong[:3, :3])]) / np.sqrt(way / 3))
    spread = np.std(errors, axis=0)
    np.testing.assert_allclose(spread, np.repeat([0.03, np.radians(2.0)], 3), rtol=0.06)
    assert [sample.stamp_ns for sample in of.odometry[:3]] == [0, PERIOD_NS, 2 * PERIOD_NS]


def test_what_is_steadily_wrong_is_a_stretch_and_a_turn_with_the_way() -> None:
    still = {"drift_m": 0.0, "drift_deg": 0.0}
    of = walk(WalkParams(poses=10, heading_deg_per_m=2.0, stretch=0.1, **still), 0)
    a, b = (of.odometry[k].T_odom_body for k in (3, 4))
    motion, true = inverse(a) @ b, inverse(of.T_world_body[3]) @ of.T_world_body[4]
    assert np.linalg.norm(motion[:3, 3]) == pytest.approx(1.1 * PLAIN.step_m)
    assert pose_error(motion, true)[0] == pytest.approx(2.0 * PLAIN.step_m, rel=1e-6)
    exact = walk(WalkParams(poses=10, **still), 0)
    np.testing.assert_allclose([sample.T_odom_body for sample in exact.odometry], exact.T_world_body, atol=1e-9)


def test_right_closures_are_of_places_met_again_and_as_good_as_they_claim() -> None:
    errors = []
    for seed in range(8):
        of = walk(PLAIN, seed)
        assert not of.is_false.any() and len(of.closures) <= PLAIN.closures
        for closure in of.closures:
            a, b = closure.from_ns // PERIOD_NS, closure.to_ns // PERIOD_NS
            assert b - a >= APART
            assert np.linalg.norm(of.T_world_body[a, :3, 3] - of.T_world_body[b, :3, 3]) <= NEAR_M
            wrong = error(of, closure)
            errors.append(np.concatenate([wrong[:3, 3], vector_from_rotation(wrong[:3, :3])]))
            expected = np.repeat([PLAIN.sigma_m, np.radians(PLAIN.sigma_deg)], 3)
            np.testing.assert_allclose(np.sqrt(np.diag(closure.covariance)), expected)
    np.testing.assert_allclose(np.std(errors, axis=0), expected, rtol=0.2)


@pytest.mark.parametrize(("false", "agreeing"), [(0.3, 0.0), (0.2, 0.1), (0.0, 0.1)])
def test_lies_have_their_share_of_all(false: float, agreeing: float) -> None:
    of = walk(WalkParams(false_share=false, agreeing_share=agreeing), 2)
    assert np.mean(of.is_false) == pytest.approx(false + agreeing, abs=0.02)
    assert [closure.to_ns for closure in of.closures] == sorted(closure.to_ns for closure in of.closures)


def test_lies_are_of_any_size_and_as_sure_as_they_like() -> None:
    found = [
        (walk_, lie) for walk_ in (walk(WalkParams(false_share=0.4), seed) for seed in range(6)) for lie in lies(walk_)
    ]
    metres = np.array([np.linalg.norm(error(of, lie)[:3, 3]) for of, lie in found])
    sigmas = np.sqrt([lie.covariance[0, 0] for _, lie in found])
    assert metres.min() >= 0.1 - 1e-9 and metres.max() <= 1e9 * (1 + 1e-9)
    assert np.percentile(metres, 25) < 100.0 and np.percentile(metres, 75) > 1e5
    assert sigmas.min() >= LEAST_SIGMA * (1 - 1e-9) and sigmas.max() <= 2e-2 * (1 + 1e-9)
    assert np.percentile(sigmas, 25) < 5e-5 and np.percentile(sigmas, 75) > 5e-4


def test_lies_that_agree_put_one_place_at_one_other() -> None:
    of = walk(WalkParams(agreeing_share=0.2, lie_m=(1.0, 5.0)), 1)
    T = of.T_world_body
    wrong = []
    for lie in lies(of):
        a, b = lie.from_ns // PERIOD_NS, lie.to_ns // PERIOD_NS
        wrong.append(T[a] @ lie.T_from_to @ inverse(T[b]))
        assert lie.from_ns < lie.to_ns
    assert len(wrong) > 3
    for one in wrong[1:]:
        np.testing.assert_allclose(one, wrong[0], atol=1e-6)
    assert pose_error(wrong[0], np.eye(4)) > (0.0, 0.0)
