# SPDX-License-Identifier: Apache-2.0
"""What a registration gives."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.geometry import inverse, pose, rotation_from_vector, vector_from_rotation
from objreg_ros.registration.candidate import KeypointAgreement
from objreg_ros.registration.gate.kinds import KINDS, readings_of
from objreg_ros.registration.gate.likelihood import log_odds, odds_of
from objreg_ros.registration.result import AcceptedRegistration, RefusedRegistration, evidence_of
from registration.samples import candidate


def motion(seed: int, scale: float = 1.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return pose(rotation_from_vector(scale * rng.normal(size=3)), scale * rng.normal(size=3))


def test_a_refusal_has_no_pose_between_any_cameras() -> None:
    refused = RefusedRegistration(reason=Reason.SLACK, detail="1 of 6", candidate=candidate())
    assert refused.T_1_2 is None and refused.covariance is None
    assert refused.between(motion(1), motion(2)) is refused


def test_between_other_cameras_the_covariance_is_that_of_many_disturbed_poses() -> None:
    T, before, behind = motion(1), motion(2), motion(3)
    sigma = 1e-3 * np.array([1.0, 2.0, 3.0, 0.5, 1.5, 1.0])
    moved = AcceptedRegistration(T_target_source=T, covariance=np.diag(sigma**2)).between(before, behind)
    assert moved.T_1_2 is not None and moved.covariance is not None
    np.testing.assert_allclose(moved.T_1_2, before @ T @ behind)
    errors = []
    for error in np.random.default_rng(0).normal(size=(4000, 6)) * sigma:
        disturbed = pose(rotation_from_vector(error[3:]) @ T[:3, :3], T[:3, 3] + error[:3])
        found = before @ disturbed @ behind
        turn = vector_from_rotation(found[:3, :3] @ inverse(moved.T_1_2)[:3, :3])
        errors.append([*(found[:3, 3] - moved.T_1_2[:3, 3]), *turn])
    np.testing.assert_allclose(np.cov(np.array(errors).T), moved.covariance, rtol=0.1, atol=4e-7)


def test_evidence_has_in_how_many_cells_keypoints_agree_where_there_are_any() -> None:
    agreement = KeypointAgreement(matches=30, cells=9, rival_matches=4, rival_cells=2)
    assert evidence_of(candidate(keypoints=agreement))["keypoints"] == 9.0
    assert "keypoints" not in evidence_of(candidate(keypoints=None))


def test_evidence_leaves_out_what_is_not_known() -> None:
    assert "correlation" not in evidence_of(candidate(correlation=None))
    assert evidence_of(candidate(score=0.5))["score"] == 0.5


def test_the_published_odds_follow_from_the_published_evidence() -> None:
    known, unknown = candidate(keypoints=None), candidate(correlation=None, silhouettes=None, perturbation_margin=None)
    for one in (known, unknown, candidate(tested=50, score_margin=-1.0)):
        evidence = evidence_of(one)
        assert 10.0 ** log_odds(evidence) == pytest.approx(evidence["odds"]) == pytest.approx(odds_of(one))
        assert set(KINDS) - set(evidence) == {name for name, reading in readings_of(one).items() if reading is None}
