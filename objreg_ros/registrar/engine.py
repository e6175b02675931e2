# SPDX-License-Identifier: Apache-2.0
"""The pose engine: hypotheses from independent chains, refined on the context, verified on the views, best first.

It returns evidence and decides nothing; `gate.py` decides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data import Alignment, Array
from objreg_ros.registrar.candidate import Candidate
from objreg_ros.registrar.consensus import distinct
from objreg_ros.registrar.covariance import spread_of, worst_translation
from objreg_ros.registrar.evidence import agreement, gather, gravity_error_deg, lead, resistance_of, unhidden, worth
from objreg_ros.registrar.hypotheses import Hypothesis, from_centroids, from_features, from_objects, from_prior
from objreg_ros.registrar.icp import align
from objreg_ros.registrar.keyframe import Keyframe
from objreg_ros.registrar.objects import explain, likeness
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Pantry, Prepared
from objreg_ros.registrar.refine import refine, settle, warp
from objreg_ros.registrar.scene_search import from_shapes, half_turned
from objreg_ros.registrar.scrutiny import liked_closely
from objreg_ros.registrar.sliding import preferred, steadied
from objreg_ros.registrar.verify import WORST, looks, rank, rate, verify

APART = (np.radians(4.0), 0.04)  # rad and m: hypotheses are distinct beyond before they are settled
ALIKE = (np.radians(0.5), 0.01)  # and after
HOPELESS = 2.0  # times the violations that the gate allows: what is not refined any more
TILTED = 1.5  # times the error of gravity that the gate allows: what is not refined either


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

    def prepare(self, keyframe: Keyframe) -> None:
        """Make a keyframe ready, before several threads propose poses of it."""
        self._pantry.get(keyframe)

    def propose(
        self, source: Keyframe, target: Keyframe, T_target_source_prior: Array | None = None
    ) -> tuple[Candidate, ...]:
        """Poses of ``source`` in ``target`` with their evidence, best first; empty when nothing could be proposed.

        ``T_target_source_prior (4, 4)`` is what odometry expects, given only where it is tight enough to start from.
        """
        pair = Pair(source=self._pantry.get(source), target=self._pantry.get(target))
        if min(len(pair.source.xyz), len(pair.target.xyz)) < self._params.min_points:
            return ()
        upright = self._upright(pair)
        seeds = self._settled(pair, self._seeds(pair, T_target_source_prior) + upright) + self._rated(pair, upright)
        if not seeds:
            return ()
        T, worth = np.array([seed.T_target_source for seed in seeds]), np.array([seed.worth for seed in seeds])
        apart = np.radians(self._params.agreement_rotation), self._params.agreement_translation
        best = distinct(T, worth, pair.source.middle, self._params.finished, *apart)
        best = [k for k in best if worth[k] >= worth.max() - self._params.finished_margin]
        candidates = merged([self._judge(pair, seeds[k], seeds) for k in best], pair.source.middle, self._params)
        rivals = [
            rival for one in candidates if self._promises(one, candidates[0]) for rival in self._turned(pair, one)
        ]
        if rivals:
            candidates = merged([*candidates, *rivals], pair.source.middle, self._params)
        return tuple(self._pushed(pair, one) if self._promises(one, candidates[0]) else one for one in candidates)

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
        """The hypotheses of one chain, brought to their basins, that look best from both views, distinct.

        All are brought near by a few points; what looks hopeless or has become another goes no farther.
        """
        if not chain:
            return []
        params, middle = self._params, pair.source.middle
        T, V = self._drawn(pair, np.array([seed.T_target_source for seed in chain]), *params.first_look)
        near = distinct(T, V, middle, params.near_per_chain, *APART)
        T, V = self._drawn(pair, T[near], params.quick_points, params.iterations, params.quick_sample)
        chosen = distinct(T, V, middle, params.refined_per_chain, np.radians(5.0), 0.10)
        return [replace(chain[near[k]], T_target_source=T[k]) for k in chosen]

    def _drawn(self, pair: Pair, T: Array, points: int, iterations: int, sample: int) -> tuple[Array, Array]:
        """Poses (K, 4, 4) drawn to the surface by the first so many ``points``, and V of a ``sample`` a side."""
        params, source, target = self._params, pair.source, pair.target
        wide, narrow, _ = params.reaches
        moved, _, _ = align(source.xyz[:points], source.normals[:points], target.surface, T, wide, narrow, iterations)
        return moved, rank(source.sight, target.sight, moved, params, sample)

    def _settled(self, pair: Pair, seeds: list[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses where the shape alone brings them, each with its worth for the views and the objects."""
        if not seeds:
            return []
        T, held = settle(pair.source, pair.target, np.array([seed.T_target_source for seed in seeds]), self._params)
        settled = [replace(seed, T_target_source=pose) for seed, pose in zip(seeds, T, strict=True)]
        return self._rated(pair, self._hopeful(pair, settled, held))

    def _hopeful(self, pair: Pair, seeds: list[Hypothesis], held: Array) -> list[Hypothesis]:
        """The hypotheses that enough points hold and that keep gravity; all of them where none does.

        Two views of nothing in common may look alike by chance: V sees what little meets, and that is not refused.
        """
        errors = [gravity_error_deg(pair.source, pair.target, seed.T_target_source) or 0.0 for seed in seeds]
        good = held & (np.array(errors) <= TILTED * self._params.max_gravity_error)
        return [seed for seed, hopeful in zip(seeds, good, strict=True) if hopeful] or seeds

    def _rated(self, pair: Pair, seeds: list[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses with their worth for the views and the objects; of those that are one pose the best has it."""
        params, source, target = self._params, pair.source, pair.target
        T = np.array([seed.T_target_source for seed in seeds]).reshape(-1, 4, 4)
        forward, backward = looks(source.sight, target.sight, T, params, params.grey_points)
        V = rate(source.sight, target.sight, forward, backward, params.grey_points)
        apart = distinct(T, V, source.middle, len(seeds), *ALIKE)
        ways = forward[apart], backward[apart]
        sharp = liked_closely(source, target, T[apart], ways, params, params.grey_points)
        rated = [replace(seed, worth=WORST) for seed in seeds]
        for k, v in zip(apart, sharp, strict=True):
            seed = seeds[k]
            explained, moved = explain(source, target, seed.T_target_source, params)
            same = likeness(source, target, explained, seed.T_target_source, params)
            rated[k] = replace(seed, worth=float(v) + agreement(explained, moved, same, params))
        return rated

    def _upright(self, pair: Pair) -> list[Hypothesis]:
        """The distinct hypotheses of the objects' shapes: they are in their basins already."""
        found = from_shapes(pair.source, pair.target, self._params)
        T, worth = np.array([seed.T_target_source for seed in found]), np.array([seed.worth for seed in found])
        chosen = distinct(T.reshape(-1, 4, 4), worth, pair.source.middle, self._params.refined_per_chain, *APART)
        return [found[k] for k in chosen]

    def _judge(self, pair: Pair, seed: Hypothesis, seeds: list[Hypothesis]) -> Candidate:
        """Finish a hypothesis and gather the evidence; ``seeds`` are all that may agree with it."""
        params, source, target = self._params, pair.source, pair.target
        alignment = self._refined(pair, seed.T_target_source)
        poses = np.array([other.T_target_source for other in seeds])
        found = seed.T_target_source, alignment.T_target_source
        same = [same_pose(poses, T_known, source.middle, params) for T_known in found]
        agreeing = [seeds[k].chain for k in np.flatnonzero(same[0] | same[1])]
        candidate = gather(source, target, alignment, (seed.chain, *agreeing), params)
        return replace(candidate, alignment=held(alignment)) if is_held(candidate, params) else candidate

    def _turned(self, pair: Pair, candidate: Candidate) -> list[Candidate]:
        """The half turn of a lone object's pose, where the views may allow it: the gate has to know of it."""
        if len(candidate.explained) != 1:
            return []
        source, target, params = pair.source, pair.target, self._params
        T = half_turned(source, target, candidate.explained[0], candidate.T_target_source, params)
        if T is None:
            return []
        seen = verify(source.sight, target.sight, T, params, params.grey_points)
        behind = unhidden(candidate.verification) - unhidden(seen)
        if behind > params.finished_margin or seen.violations > HOPELESS * params.max_violations:
            return []
        return [gather(source, target, refine(source, target, T, params), ("objects",), params)]

    def _promises(self, candidate: Candidate, best: Candidate) -> bool:
        """Whether the gate may come to a candidate, so that it is worth pushing."""
        least = max(self._params.min_score, best.verification.score - self._params.rival_margin)
        return candidate.verification.score >= least

    def _pushed(self, pair: Pair, candidate: Candidate) -> Candidate:
        """The candidate with how the views resist a push."""
        drop = resistance_of(candidate, pair.source, pair.target, self._params)
        return self._steadied(pair, replace(candidate, resistance=drop))

    def _refined(self, pair: Pair, T_target_source: Array) -> Alignment:
        """The refined pose; where that is known badly, the one that the views like best of all that it could be."""
        params, source, target = self._params, pair.source, pair.target
        alignment = refine(source, target, T_target_source, params)
        C = spread_of(alignment, params) + warp(source, target, alignment.T_target_source, params)
        if worst_translation(C) <= params.doubtful_sigma:
            return alignment
        better = preferred(source, target, alignment.T_target_source, C, params)
        return alignment if better is None else refine(source, target, better, params)

    def _steadied(self, pair: Pair, candidate: Candidate) -> Candidate:
        """The candidate with what the views tell of a doubtful position that does not slide freely."""
        alignment, C = candidate.alignment, spread_of(candidate.alignment, self._params)
        if candidate.resistance is None or len(alignment.slack) > 0:
            return candidate
        added = steadied(pair.source, pair.target, alignment.T_target_source, C + candidate.warp, self._params)
        steady = replace(alignment, information=alignment.information + added)
        whole = np.linalg.inv(np.linalg.inv(C + candidate.warp) + added)
        return replace(candidate, alignment=steady, warp=whole - np.linalg.inv(np.linalg.inv(C) + added))


def is_held(candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether what the surfaces let slide is held by the outline and the print of an object."""
    alike = candidate.likeness
    return candidate.yaw_known and alike is not None and alike >= params.holding_likeness


def held(alignment: Alignment) -> Alignment:
    """The alignment without its slack."""
    return replace(alignment, slack=np.zeros((0, 6)))


def merged(candidates: list[Candidate], middle: Array, params: RegistrarParams) -> list[Candidate]:
    """Distinct candidates, best first; each knows the chains of those that came to its pose."""
    ranked = sorted(candidates, key=lambda candidate: -worth(candidate, params))
    poses = np.array([candidate.T_target_source for candidate in ranked])
    kept: list[Candidate] = []
    known = np.zeros(len(ranked), bool)
    for k, candidate in enumerate(ranked):
        if not known[k]:
            same = same_pose(poses, poses[k], middle, params)
            chains = {chain for j in np.flatnonzero(same) for chain in ranked[j].agreeing_chains}
            kept.append(replace(candidate, agreeing_chains=tuple(sorted(chains))))
            known |= same
    return [replace(candidate, margin=lead(candidate, kept, params)) for candidate in kept]


def same_pose(T: Array, T_known: Array, middle: Array, params: RegistrarParams) -> Array:
    """Which poses (K, 4, 4) differ from one by less than the tolerance of agreement, seen from the context's middle."""
    cosine = 0.5 * (np.einsum("kij,ij->k", T[:, :3, :3], T_known[:3, :3]) - 1.0)
    moved = np.linalg.norm((T[:, :3, :3] - T_known[:3, :3]) @ middle + T[:, :3, 3] - T_known[:3, 3], axis=-1)
    close = cosine > np.cos(np.radians(params.agreement_rotation))
    return np.asarray(close & (moved < params.agreement_translation))
