# SPDX-License-Identifier: Apache-2.0
"""The founding method: exact where it can be, honest where it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector, skew, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration import paper
from objreg_ros.registration.certainty.covariance import spread_of
from objreg_ros.registration.paper import LEAST_PAIRS, PaperEngine, _one_to_one, register
from registration import rooms

PARAMS = RegistrarParams(method="paper")


def _corner() -> np.ndarray:
    """Points on three faces of a box: no motion leaves them upon themselves."""
    u, v = np.random.default_rng(0).uniform(0.0, 0.2, (2, 900))
    faces = [np.stack([u, 0.7 * v, 0 * u], 1), np.stack([u, 0 * u, v], 1), np.stack([0 * u, 0.6 * u, 0.8 * v], 1)]
    return np.add(np.concatenate(faces), (0.1, -0.05, 1.0))


@pytest.mark.parametrize("angle", [0.05, -0.1])
def test_a_small_motion_of_the_same_points_is_found_exactly(angle: float) -> None:
    T = pose(rotation_from_vector(np.array([0.0, angle, 0.02])), np.array([0.01, -0.01, 0.005]))
    about = pose(np.eye(3), np.array([0.1, 0.0, 1.0]))
    T = about @ T @ inverse(about)
    source = _corner()
    found = register(source, transform(T, source), np.eye(4))
    assert found is not None and found.converged
    rotation, distance = pose_error(found.T_target_source, T)
    assert rotation < 0.1 and distance < 0.1 and found.rmse < 1e-3


def test_a_start_from_the_truth_stays_there_and_its_covariance_is_valid() -> None:
    T = pose(rotation_from_vector(np.array([0.0, 2.0, 0.0])), np.array([1.0, 0.0, 2.0]))
    found = register(_corner(), transform(T, _corner()), T)
    assert found is not None and np.allclose(found.T_target_source, T, atol=1e-9)
    assert np.linalg.eigvalsh(spread_of(found)).min() > 0


def test_the_information_is_that_of_a_step_about_the_camera_of_every_point() -> None:
    T = pose(rotation_from_vector(np.array([0.3, 2.0, -0.5])), np.array([1.0, 0.0, 2.0]))
    found = register(_corner(), transform(T, _corner()), T)
    J = np.concatenate([np.hstack([np.eye(3), -skew(T[:3, :3] @ point)]) for point in _corner()])
    assert found is not None and np.allclose(found.information * 1e-8, J.T @ J, atol=1e-6 * len(J))


def test_fewer_than_six_pairs_give_nothing() -> None:
    points = _corner()[::200]
    for count in (LEAST_PAIRS - 1, LEAST_PAIRS):
        found = register(points[:count], points[:count], np.eye(4))
        assert (found is None) is (count < LEAST_PAIRS)


def test_of_the_points_that_share_a_partner_the_closest_has_it() -> None:
    pairs = np.array([[0, 0], [1, 0], [2, 1]])
    assert _one_to_one(pairs, np.array([0.02, 0.01, 0.0])).tolist() == [1, 2]


def test_iterations_that_end_too_early_are_not_called_converged(monkeypatch: pytest.MonkeyPatch) -> None:
    about = pose(rotation_from_vector(np.array([0.0, 0.1, 0.02])), np.array([-0.1, 0.0, 0.02]))
    enough = register(_corner(), transform(about, _corner()), np.eye(4))
    monkeypatch.setattr(paper, "ITERATIONS", 2)
    few = register(_corner(), transform(about, _corner()), np.eye(4))
    assert few is not None and enough is not None and (few.converged, enough.converged) == (False, True)


def test_the_same_clouds_give_the_same_pose_to_the_last_bit() -> None:
    target = np.add(_corner()[::2], (0.02, 0.01, 0.0))
    poses = [register(_corner(), target, np.eye(4)) for _ in range(8)]
    assert len({found.T_target_source.tobytes() for found in poses if found is not None}) == 1


def test_the_middle_of_what_was_aligned_is_that_of_the_points_in_the_target_frame() -> None:
    xyz = _corner()
    found = register(xyz, xyz, np.eye(4))
    assert found is not None and np.allclose(found.middle, xyz.mean(axis=0))


def test_points_out_of_reach_of_each_other_give_nothing() -> None:
    assert register(_corner(), np.add(_corner(), 5.0), np.eye(4)) is None


def test_correspondences_are_one_to_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "PAIR_DISTANCE_M", 0.05)
    source = np.array(
        [[0, 0, 1], [0.001, 0, 1], [0.002, 0, 1]] + [[0.1 * i, 0.1 * i * i, 1] for i in range(1, 9)], float
    )
    target = source[2:]
    found = register(source, target, np.eye(4))
    assert found is not None and found.inliers == len(target)


def test_it_proposes_one_pose_for_each_pair_of_one_label_with_the_evidence_of_the_views() -> None:
    source, target = (rooms.keyframe(rooms.seen_from(angle)) for angle in (2.0, 0.0))
    source, target = replace(source, keyframe_id=1), replace(target, keyframe_id=2)
    found = PaperEngine(PARAMS).propose(source, target)
    assert 1 <= len(found) <= len(target.objects)
    assert {candidate.proposer for candidate in found} == {"paper"}
    scores = [candidate.verification.score for candidate in found]
    assert scores == sorted(scores, reverse=True)
