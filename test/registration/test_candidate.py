# SPDX-License-Identifier: Apache-2.0
"""What the gate is handed."""

from __future__ import annotations

import numpy as np

from objreg_ros.registration.candidate import Candidate, ObjectPair
from objreg_ros.registration.gate.verdict import refuse
from registration.samples import candidate, moved


def bare() -> Candidate:
    """What views say well of, and nothing else is known of."""
    full = candidate()
    return Candidate(
        alignment=full.alignment, proposer="features", agreeing_proposers=("features",), verification=full.verification
    )


def test_the_pose_of_a_candidate_is_that_of_its_alignment() -> None:
    assert np.array_equal(candidate(moved(0.3)).T_target_source, moved(0.3))


def test_a_candidate_of_which_only_the_views_speak_well_is_refused() -> None:
    assert refuse(candidate()) is None
    assert refuse(bare()) is not None


def test_what_is_not_known_of_a_candidate_does_not_speak_for_it() -> None:
    one = bare()
    assert one.matched == one.moved == ()
    assert one.gravity_error_deg is one.silhouette_score is one.silhouettes is one.perturbation_margin is None
    assert (one.yaw_known, one.score_margin, one.certain_violations) == (False, 0.0, 1.0)


def test_no_two_candidates_share_the_covariance_that_a_warp_adds() -> None:
    one, other = bare(), bare()
    one.systematic_depth_error[0, 0] = 1.0
    assert one.systematic_depth_error.shape == (6, 6) and not other.systematic_depth_error.any()


def test_a_pair_of_objects_names_the_source_first() -> None:
    source, target, label = ObjectPair(1, 2, "cup")
    assert (source, target, label) == (1, 2, "cup") and ObjectPair(1, 2, "cup").source == 1
