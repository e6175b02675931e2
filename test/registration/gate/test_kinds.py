# SPDX-License-Identifier: Apache-2.0
"""How evidence is read from a candidate."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.gate.kinds import KINDS, readings_of
from registration.samples import candidate, moved

CUPS = tuple(ObjectPair(k, k, "cup") for k in range(3))


def test_a_reading_is_the_candidate_s_own_number_or_unknown() -> None:
    for evidence, name, reading in [
        ({"tested": 1000}, "tested", 1000.0),
        ({"tested": 0}, "tested", 0.0),
        ({"certain_violations": 0.01}, "certain_violations", 0.01),
        ({"correlation": 0.4}, "correlation", 0.4),
        ({"correlation": None}, "correlation", None),
        ({"silhouettes": -0.5}, "silhouettes", -0.5),
        ({"silhouettes": None}, "silhouettes", None),
        ({"matched": CUPS}, "matched", 3.0),
        ({"agreeing_proposers": ("centroids", "objects", "odometry")}, "proposers", 1.0),
        ({"score_margin": 0.3}, "score_margin", 0.3),
        ({"perturbation_margin": 0.2}, "perturbation_margin", 0.2),
        ({"perturbation_margin": None}, "perturbation_margin", None),
        ({"systematic_depth_error": 0.09 * np.eye(6)}, "position_sigma", pytest.approx(0.3, rel=0.01)),
        ({"middle": np.array([0.0, 0.0, 3.0])}, "range", 3.0),
    ]:
        assert readings_of(candidate(**evidence))[name] == reading, evidence


def test_the_range_is_that_of_both_cameras() -> None:
    assert readings_of(candidate(moved(-2.0), middle=np.array([0.0, 0.0, 3.0])))["range"] > 3.0


def test_a_pose_of_lower_view_score_is_known_worse() -> None:
    low, high = (readings_of(candidate(score=score))["scaled_sigma"] for score in (0.2, 0.9))
    assert low is not None and high is not None and low > high


def test_knots_ascend_and_every_kind_has_words_for_a_refusal() -> None:
    for kind in KINDS.values():
        assert list(kind.knots) == sorted(set(kind.knots)) and kind.phrase
