# SPDX-License-Identifier: Apache-2.0
"""The pose engine: hypotheses from independent chains, refined on the context, verified on the views, best first.

It returns evidence and decides nothing; `gate.py` decides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import rotation_angle
from objreg_ros.registrar.candidate import Candidate
from objreg_ros.registrar.consensus import distinct
from objreg_ros.registrar.hypotheses import Hypothesis, from_centroids, from_features, from_objects, from_prior
from objreg_ros.registrar.icp import align
from objreg_ros.registrar.keyframe import Keyframe
from objreg_ros.registrar.objects import explain
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Pantry, Prepared
from objreg_ros.registrar.refine import refine
from objreg_ros.registrar.verify import rank, verify


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """Two keyframes made ready to be registered."""

    source: Prepared
    target: Prepared


class Engine:
    """Registers keyframes. Deterministic: the same keyframes and parameters give the same candidates."""

    def __init__(self, params: RegistrarParams) -> None:
        self._params = params
        self._pantry = Pantry(params)

    def propose(
        self, source: Keyframe, target: Keyframe, T_target_source_prior: Array | None = None
    ) -> tuple[Candidate, ...]:
        """Poses of ``source`` in ``target`` with their evidence, best first; empty when nothing could be proposed.

        ``T_target_source_prior (4, 4)`` is what odometry expects, given only where it is tight enough to start from.
        """
        pair = Pair(source=self._pantry.get(source), target=self._pantry.get(target))
        if min(len(pair.source.xyz), len(pair.target.xyz)) < self._params.min_points:
            return ()
        seeds = self._seeds(pair, T_target_source_prior)
        candidates = [self._judge(pair, seed) for seed in seeds]
        return tuple(merged(candidates, pair.source.middle, self._params))

    def _seeds(self, pair: Pair, prior: Array | None) -> list[Hypothesis]:
        """The hypotheses of each chain that the views like best."""
        source, target, params = pair.source, pair.target, self._params
        chains = [
            from_prior(prior),
            from_centroids(source, target, params),
            from_objects(source, target, params),
            from_features(source, target, params),
        ]
        return [seed for chain in chains for seed in self._best(pair, chain)]

    def _best(self, pair: Pair, chain: list[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses of one chain, brought to their basins, that look best from both views, distinct."""
        if not chain:
            return []
        params, source, target = self._params, pair.source, pair.target
        few = slice(params.quick_points)
        T, _, _ = align(
            source.xyz[few], source.normals[few], target.surface, np.array([seed.T_target_source for seed in chain]),
            params.reaches[0], params.reaches[1], params.iterations,
        )  # fmt: skip
        V = rank(source.sight, target.sight, T, params, params.quick_sample)
        chosen = distinct(T, V, source.middle, params.refined_per_chain, np.radians(5.0), 0.10)
        return [replace(chain[k], T_target_source=T[k]) for k in chosen]

    def _judge(self, pair: Pair, seed: Hypothesis) -> Candidate:
        """Refine a hypothesis and gather the evidence."""
        params, source, target = self._params, pair.source, pair.target
        alignment = refine(source, target, seed.T_target_source, params)
        T = alignment.T_target_source
        explained, moved = explain(source, target, T, params)
        return Candidate(
            alignment=alignment,
            chain=seed.chain,
            agreeing_chains=(seed.chain,),
            verification=verify(source.sight, target.sight, T, params),
            explained=explained,
            moved=moved,
            gravity_error_deg=gravity_error_deg(source, target, T),
        )


def gravity_error_deg(source: Prepared, target: Prepared, T_target_source: Array) -> float | None:
    """The angle between the two gravities under a pose; None where one is unknown."""
    if source.up is None or target.up is None:
        return None
    return float(np.degrees(np.arccos(np.clip(T_target_source[:3, :3] @ source.up @ target.up, -1.0, 1.0))))


def merged(candidates: list[Candidate], middle: Array, params: RegistrarParams) -> list[Candidate]:
    """Distinct candidates, best first; each knows which other chains came to its pose."""
    ranked = sorted(candidates, key=lambda candidate: -worth(candidate, params))
    kept: list[Candidate] = []
    for candidate in ranked:
        if not any(same_pose(candidate, other, middle, params) for other in kept):
            chains = {other.chain for other in ranked if same_pose(candidate, other, middle, params)}
            kept.append(replace(candidate, agreeing_chains=tuple(sorted(chains))))
    return kept


def worth(candidate: Candidate, params: RegistrarParams) -> float:
    """What candidates are ranked by: the views' verdict, and the objects' where rooms repeat themselves."""
    objects = min(2, len(candidate.explained)) - min(2, len(candidate.moved))
    return candidate.verification.score + params.object_bonus * objects


def same_pose(a: Candidate, b: Candidate, middle: Array, params: RegistrarParams) -> bool:
    """Whether two candidates differ by less than the tolerance of agreement, seen from the middle of the context."""
    Ta, Tb = a.T_target_source, b.T_target_source
    turned = np.degrees(rotation_angle(Ta[:3, :3].T @ Tb[:3, :3]))
    moved = np.linalg.norm(Ta[:3, :3] @ middle + Ta[:3, 3] - Tb[:3, :3] @ middle - Tb[:3, 3])
    return bool(turned < params.agreement_rotation and moved < params.agreement_translation)
