# SPDX-License-Identifier: Apache-2.0
"""The way of one pair, from its keyframes to its verdict."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.geometry import inverse, pose_error
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration import align, method_of
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import covariance_of
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.verdict import Refusal
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.paper import PaperEngine
from objreg_ros.registration.propose.prior import TIGHT_TRANSLATION_M, Prior
from registration.rooms import keyframe, seen_from
from registration.samples import candidate, moved

PARAMS = RegistrarParams()
HERE, THERE = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2)


class Fixed:
    """A method that proposes what it was given, and remembers how it was asked."""

    def __init__(self, *candidates: Candidate) -> None:
        self.candidates, self.prepared, self.starts = candidates, list[Keyframe](), list[object]()

    def prepare(self, keyframe: Keyframe) -> None:
        self.prepared.append(keyframe)

    def propose(self, source: Keyframe, target: Keyframe, T_target_source_prior: object = None) -> tuple:
        self.starts.append(T_target_source_prior)
        return self.candidates


def test_a_place_seen_again_is_accepted_with_pose_covariance_and_evidence() -> None:
    found = align(HERE, THERE)
    assert found.accepted and found.reason is None and found.T_1_2 is not None and found.covariance is not None
    degrees, cm = pose_error(found.T_1_2, inverse(seen_from(20.0)) @ seen_from(0.0))
    assert degrees < 1.0 and cm < 2.0
    assert np.linalg.eigvalsh(found.covariance).min() > 0
    assert found.evidence["score"] > 0 and found.evidence["matched"] >= 1


def test_without_a_candidate_the_reason_says_so_and_there_is_nothing_else() -> None:
    refused = align(HERE, THERE, method=Fixed())
    assert not refused.accepted and refused.reason == Reason.NO_HYPOTHESIS and refused.detail
    assert refused.T_1_2 is None and refused.covariance is None
    assert refused.evidence == {} and refused.candidate is None


def test_a_refusal_gives_the_evidence_of_the_best_candidate_and_gives_no_pose() -> None:
    best = candidate(violations=0.4)
    refused = align(HERE, THERE, method=Fixed(best))
    assert refused.reason == Reason.FREE_SPACE and refused.T_1_2 is None and refused.covariance is None
    assert refused.evidence["violations"] == 0.4 and refused.candidate is best


def test_both_keyframes_are_prepared_and_the_covariance_is_that_of_the_accepted_candidate() -> None:
    method, one = Fixed(candidate()), candidate()
    found = align(HERE, THERE, method=method, gate=lambda candidates, prior=None: one)
    assert method.prepared == [HERE, THERE] and found.candidate is one
    assert found.covariance is not None and np.array_equal(found.covariance, covariance_of(one, PARAMS))


def test_a_gate_of_ones_own_decides() -> None:
    def never(candidates: Sequence[Candidate], prior: Prior | None = None) -> Refusal:
        return Reason.MOVED, f"{len(candidates)} candidates"

    refused = align(HERE, THERE, method=Fixed(candidate(), candidate(moved(1.0))), gate=never)
    assert (refused.reason, refused.detail) == (Reason.MOVED, "2 candidates")


def test_our_gate_decides_by_the_limits_that_a_user_sets() -> None:
    method, strict = Fixed(candidate(moved(1.0))), PARAMS.replaced(max_translation=0.5)
    assert align(HERE, THERE, method=method).accepted
    assert not align(HERE, THERE, params=strict, method=method).accepted


@pytest.mark.parametrize("tight", [True, False])
def test_a_pose_starts_from_the_prior_where_that_is_tight(tight: bool) -> None:
    metres = TIGHT_TRANSLATION_M * (0.5 if tight else 2.0)
    prior = Prior(T_target_source=np.eye(4), rotation_deg=1.0, translation_m=metres, trusted=False)
    method = Fixed(candidate())
    align(HERE, THERE, prior, method=method)
    assert (method.starts[0] is not None) == tight


def test_a_trusted_prior_that_disagrees_refuses() -> None:
    prior = Prior(T_target_source=moved(5.0), rotation_deg=0.1, translation_m=0.01, trusted=True)
    assert align(HERE, THERE, prior, method=Fixed(candidate())).reason == Reason.ODOMETRY


def test_the_parameters_name_the_method() -> None:
    assert isinstance(method_of(PARAMS), Engine)
    assert isinstance(method_of(PARAMS.replaced(method="paper")), PaperEngine)


def test_a_keyframe_without_objects_is_refused() -> None:
    assert not align(replace(HERE, objects=()), THERE).accepted


def test_the_way_of_a_pair_is_read_in_forty_lines() -> None:
    assert len(inspect.getsource(align).splitlines()) <= 40
    assert len(inspect.getsource(Engine.propose).splitlines()) <= 40
