# SPDX-License-Identifier: Apache-2.0
"""Tests of the refinement."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.registrar.refine import prepare_cloud, refine

from .rooms import keyframe, seen_from

TRUTH = inverse(seen_from(20.0)) @ seen_from(0.0)
OFF = pose(rotation_from_vector(np.array([0.02, 0.06, -0.03])), np.array([0.04, -0.03, 0.05]))


@pytest.fixture(scope="module")
def clouds():
    return tuple(prepare_cloud(keyframe(seen_from(a), seed=k).context.xyz, 0.03) for k, a in enumerate((0.0, 20.0)))


def test_a_shifted_start_comes_back_to_the_truth(clouds) -> None:
    found = refine(*clouds, OFF @ TRUTH, (0.12, 0.05), 30)
    rotation, distance = pose_error(found.T_target_source, TRUTH)
    assert rotation < 0.5 and distance < 1.0 and found.converged


def test_the_inverted_problem_has_the_inverted_answer(clouds) -> None:
    found = refine(clouds[1], clouds[0], inverse(OFF @ TRUTH), (0.12, 0.05), 30)
    rotation, distance = pose_error(found.T_target_source, inverse(TRUTH))
    assert rotation < 0.5 and distance < 1.0


def test_information_is_positive_and_symmetric(clouds) -> None:
    information = refine(*clouds, TRUTH, (0.05,), 10).information
    assert np.allclose(information, information.T, rtol=1e-6)
    assert np.linalg.eigvalsh(information).min() > 0


def test_a_start_far_away_has_no_inliers(clouds) -> None:
    found = refine(*clouds, pose(np.eye(3), np.array([50.0, 0.0, 0.0])), (0.05,), 5)
    assert found.inliers == 0 and not found.converged


def test_too_few_points_make_no_cloud() -> None:
    assert prepare_cloud(np.zeros((10, 3), np.float32), 0.03) is None
