# SPDX-License-Identifier: Apache-2.0
"""The pose engine: hypotheses from independent proposers, refined on the context, verified on the views, best first.

It returns evidence and decides nothing; `gate` decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Alignment
from objreg_ros.registration.api import Proposer, Scorer
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import covariance_of, spread_of, worst_translation
from objreg_ros.registration.certainty.degeneracy import systematic_depth_error
from objreg_ros.registration.certainty.gravity_update import gravity_update
from objreg_ros.registration.certainty.observability import DOUBTFUL_SIGMA_M, better_pose, regularising_information
from objreg_ros.registration.kernels.same_pose import AGREEING, near
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.prepare.prepared import Pair
from objreg_ros.registration.prepare.prepared_cache import PreparedCache
from objreg_ros.registration.propose.competing_hypotheses import competing_poses
from objreg_ros.registration.propose.evidence import (
    CONSIDERED_MARGIN,
    gather,
    margin_over,
    perturbation_margin_of,
    rank_score,
    surroundings_of,
)
from objreg_ros.registration.propose.hypotheses import Hypothesis
from objreg_ros.registration.propose.refinement import refine
from objreg_ros.registration.propose.shortlist import shortlist
from objreg_ros.registration.refine.batch_icp import LEAST_PAIRS
from objreg_ros.registration.score.keypoint_agreement import agreements
from objreg_ros.registration.score.view_score import LEAST_SCORE

HOLDING_SILHOUETTE_SCORE = 0.3  # of an object from which on it resolves a degenerate direction


class Engine:
    """Registers keyframes. Deterministic: the same keyframes and parameters give the same candidates.

    ``propose`` and ``score`` may be one's own: `registration.api`.
    """

    def __init__(self, params: RegistrationParams, propose: Proposer = shortlist, score: Scorer = gather) -> None:
        self._params = params
        self._shortlist, self._score = propose, score
        self._cache = PreparedCache(params)

    def prepare(self, keyframe: Keyframe) -> None:
        """Make a keyframe ready, before several threads propose poses of it."""
        self._cache.get(keyframe)

    def propose(
        self, source: Keyframe, target: Keyframe, T_target_source_prior: Array | None = None
    ) -> tuple[Candidate, ...]:
        """Poses of ``source`` in ``target`` with their evidence, best first; empty when nothing could be proposed.

        ``T_target_source_prior (4, 4)`` is what odometry expects, given only where it is tight enough to start from.
        """
        # prepare/: each keyframe once
        pair = Pair(source=self._cache.get(source), target=self._cache.get(target))
        if min(len(pair.source.xyz), len(pair.target.xyz)) < LEAST_PAIRS:
            return ()
        # propose/: the hypotheses to finish, of all that the proposers propose
        best, hypotheses, of_keypoints = self._shortlist(pair, T_target_source_prior)
        if not best:
            return ()
        # refine/ and score/: each is refined, and its evidence gathered
        candidates = merged([self._judge(pair, hypothesis, hypotheses) for hypothesis in best], pair.source.middle)
        # propose/: what else a lone object's pose could be, refined and scored alike
        competitors = self._competitors(pair, [one for one in candidates if self._promises(one, candidates[0])])
        if competitors:
            candidates = merged([*candidates, *competitors], pair.source.middle)
        candidates = with_keypoints(pair, candidates, of_keypoints)
        # certainty/: how the views resist a perturbation, and what gravity adds
        perturbed = (self._perturbed(pair, one) if self._promises(one, candidates[0]) else one for one in candidates)
        return tuple(self._gravity_updated(pair, one) for one in perturbed)

    def _judge(self, pair: Pair, hypothesis: Hypothesis, hypotheses: Sequence[Hypothesis]) -> Candidate:
        """Finish a hypothesis and gather the evidence; ``hypotheses`` are all that may agree with it."""
        source = pair.source
        alignment = self._refined(pair, hypothesis.T_target_source)
        poses = np.array([other.T_target_source for other in hypotheses])
        found = hypothesis.T_target_source, alignment.T_target_source
        same = [near(poses, T_known, source.middle, AGREEING) for T_known in found]
        agreeing = [other.proposer for other, agrees in zip(hypotheses, same[0] | same[1], strict=True) if agrees]
        return self._gathered(pair, alignment, (hypothesis.proposer, *agreeing))

    def _gathered(self, pair: Pair, alignment: Alignment, proposers: Sequence[str]) -> Candidate:
        """The candidate of an alignment, without degenerate directions where an object resolves them."""
        candidate = self._score(pair.source, pair.target, alignment, proposers)
        return (
            replace(candidate, alignment=without_degeneracy(alignment)) if resolves_degeneracy(candidate) else candidate
        )

    def _competitors(self, pair: Pair, candidates: Sequence[Candidate]) -> list[Candidate]:
        """What else lone objects' poses could be, for all that the views say: the gate has to know of it.

        What comes to a candidate's pose is left out: it was looked for from there, and is no proposer that agrees.
        """
        source, target = pair.source, pair.target
        poses = [T for one in candidates for T in competing_poses(source, target, one)]
        known, competitors = np.array([one.T_target_source for one in candidates]), []
        for alignment in (refine(source, target, T) for T in poses):
            if not near(known, alignment.T_target_source, source.middle, AGREEING).any():
                competitors.append(self._gathered(pair, alignment, ("objects",)))
        return competitors

    def _promises(self, candidate: Candidate, best: Candidate) -> bool:
        """Whether the gate may come to a candidate, so that it has to be perturbed."""
        least = max(LEAST_SCORE, best.verification.score - CONSIDERED_MARGIN)
        return candidate.verification.score >= least

    def _perturbed(self, pair: Pair, candidate: Candidate) -> Candidate:
        """The candidate with its score margin under perturbation, and what the views say without its objects."""
        asked = candidate, pair.source, pair.target
        perturbed = replace(
            candidate, perturbation_margin=perturbation_margin_of(*asked), surroundings=surroundings_of(*asked)
        )
        return self._regularised(pair, perturbed)

    def _gravity_updated(self, pair: Pair, candidate: Candidate) -> Candidate:
        """The candidate brought within its covariance to where gravity is kept, and known better by it.

        Its evidence stays that of the pose with the best view score.
        """
        C = covariance_of(candidate, self._params) + candidate.systematic_depth_error
        update = gravity_update(pair.source, pair.target, candidate.T_target_source, C)
        if update is None:
            return candidate
        T_target_source, information = update
        return self._informed(brought(candidate, T_target_source), information)

    def _refined(self, pair: Pair, T_target_source: Array) -> Alignment:
        """The refined pose; where that is known badly, the one of the best view score of all that it could be."""
        source, target = pair.source, pair.target
        alignment = refine(source, target, T_target_source)
        C = spread_of(alignment) + systematic_depth_error(source, target, alignment.T_target_source)
        if worst_translation(C) <= DOUBTFUL_SIGMA_M:
            return alignment
        better = better_pose(source, target, alignment.T_target_source, C)
        return alignment if better is None else refine(source, target, better)

    def _regularised(self, pair: Pair, candidate: Candidate) -> Candidate:
        """The candidate with what the views add to a doubtful position that does not slide freely."""
        alignment, C = candidate.alignment, spread_of(candidate.alignment)
        if candidate.perturbation_margin is None or len(alignment.degenerate) > 0:
            return candidate
        added = regularising_information(
            pair.source, pair.target, alignment.T_target_source, C + candidate.systematic_depth_error
        )
        return self._informed(candidate, added)

    def _informed(self, candidate: Candidate, added: Array) -> Candidate:
        """The candidate with information (6, 6) that neither the residuals nor a systematic depth error know of."""
        alignment, C = candidate.alignment, spread_of(candidate.alignment)
        informed = replace(alignment, information=alignment.information + added)
        whole = np.linalg.inv(np.linalg.inv(C + candidate.systematic_depth_error) + added)
        return replace(
            candidate, alignment=informed, systematic_depth_error=whole - np.linalg.inv(np.linalg.inv(C) + added)
        )


def resolves_degeneracy(candidate: Candidate) -> bool:
    """Whether what the surfaces leave degenerate is resolved by the outline and the print of an object."""
    score = candidate.silhouette_score
    return candidate.yaw_known and score is not None and score >= HOLDING_SILHOUETTE_SCORE


def brought(candidate: Candidate, T_target_source: Array) -> Candidate:
    """The candidate at another pose nearby, with the evidence that it has."""
    return replace(candidate, alignment=replace(candidate.alignment, T_target_source=T_target_source))


def without_degeneracy(alignment: Alignment) -> Alignment:
    """The alignment without its degenerate directions."""
    return replace(alignment, degenerate=np.zeros((0, 6)))


def with_keypoints(pair: Pair, candidates: list[Candidate], proposed: Sequence[Hypothesis]) -> list[Candidate]:
    """The candidates with what the keypoints say of each; what these ``proposed`` may be its rival."""
    found = agreements(pair, *(np.array([one.T_target_source for one in ones]) for ones in (candidates, proposed)))
    return [replace(one, keypoints=agreement) for one, agreement in zip(candidates, found, strict=True)]


def merged(candidates: list[Candidate], middle: Array) -> list[Candidate]:
    """Distinct candidates, best first; each knows the proposers of those that came to its pose."""
    ranked = sorted(candidates, key=lambda candidate: -rank_score(candidate).total)
    poses = np.array([candidate.T_target_source for candidate in ranked])
    kept: list[Candidate] = []
    known = np.zeros(len(ranked), bool)
    for k, candidate in enumerate(ranked):
        if not known[k]:
            same = near(poses, poses[k], middle, AGREEING)
            proposers = {proposer for j in np.flatnonzero(same) for proposer in ranked[j].agreeing_proposers}
            kept.append(replace(candidate, agreeing_proposers=tuple(sorted(proposers))))
            known |= same
    return [replace(candidate, score_margin=margin_over(candidate, kept)) for candidate in kept]
