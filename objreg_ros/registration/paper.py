# SPDX-License-Identifier: Apache-2.0
"""The founding method, selectable as ``method: paper``: pairwise point-to-point ICP of objects of one label.

Besl and McKay, "A method for registration of 3-D shapes" (1992): nearest neighbours from a kd-tree, pairs rejected by
distance and thinned to one-to-one, the motion from the singular value decomposition (Arun et al., "Least-squares
fitting of two 3-D point sets", 1987), from rest, until it settles. It answers to the same gate as every other method,
with the same evidence.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from objreg_ros.data import Alignment, Array
from objreg_ros.geometry import rigid_fit, transform
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.engine import merged
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import Pantry, Prepared
from objreg_ros.registration.propose.evidence import gather, resistance_of

LEAST_PAIRS = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pairs:
    """Indices of the points that correspond, one-to-one, and their distances in m."""

    source: Array
    target: Array
    distance: Array


class PaperEngine:
    """Proposes a pose for each pair of objects of one label; the counterpart of `Engine`."""

    def __init__(self, params: RegistrarParams) -> None:
        self._params = params
        self._pantry = Pantry(params)

    def prepare(self, keyframe: Keyframe) -> None:
        """Make a keyframe ready, before several threads propose poses of it."""
        self._pantry.get(keyframe)

    def propose(
        self, source: Keyframe, target: Keyframe, T_target_source_prior: Array | None = None
    ) -> tuple[Candidate, ...]:
        """Poses of ``source`` in ``target``, the best verified first. ICP starts from rest, never from a prior."""
        alignments = [
            register(a.cloud.xyz, b.cloud.xyz, np.eye(4), self._params)
            for a in source.objects
            for b in target.objects
            if a.label == b.label
        ]
        pair = self._pantry.get(source), self._pantry.get(target)
        found = [self._candidate(*pair, alignment) for alignment in alignments if alignment is not None]
        return tuple(merged(found, pair[0].middle, self._params))

    def _candidate(self, source: Prepared, target: Prepared, alignment: Alignment) -> Candidate:
        candidate = gather(source, target, alignment, ("paper",), self._params)
        return replace(candidate, resistance=resistance_of(candidate, source, target, self._params))


def register(source: Array, target: Array, T_target_source: Array, params: RegistrarParams) -> Alignment | None:
    """Point-to-point ICP of points (N, 3) upon (M, 3) from a start; None where too few points correspond."""
    tree, T = cKDTree(target), T_target_source
    error, iterations, converged = np.inf, 0, False
    while iterations < params.paper_iterations and not converged:
        pairs = _correspond(tree, transform(T, source.astype(float)), params.paper_distance)
        if len(pairs.source) < LEAST_PAIRS:
            return None
        T = rigid_fit(source[pairs.source].astype(float), target[pairs.target].astype(float))
        before, error = error, float(np.mean(pairs.distance))
        converged = abs(before - error) < params.paper_tolerance
        iterations += 1
    return Alignment(
        T_target_source=T,
        information=_information(source[pairs.source], T, pairs.distance),
        inliers=len(pairs.source),
        overlap=len(pairs.source) / len(source),
        rmse=float(np.sqrt(np.mean(np.square(pairs.distance)))),
        converged=converged,
        middle=transform(T, source.astype(float)).mean(axis=0),
    )


def _correspond(tree: cKDTree, moved: Array, most: float) -> _Pairs:
    """The nearest target of each point within ``most`` m; of the points that share a target the closest keeps it."""
    distance, target = tree.query(moved, distance_upper_bound=most)
    source = np.flatnonzero(np.isfinite(distance))
    source = source[np.lexsort((distance[source], target[source]))]
    _, first = np.unique(target[source], return_index=True)
    kept = source[first]
    return _Pairs(source=kept, target=target[kept], distance=distance[kept])


def _information(source: Array, T: Array, distance: Array) -> Array:
    """``J^T J / sigma^2`` of the point-to-point errors, for a step [t r] in the target's axes about the camera."""
    x, y, z = (source.astype(float) @ T[:3, :3].T).T
    J = np.zeros((len(source), 3, 6))
    J[:, :, :3] = np.eye(3)
    J[:, 0, 4], J[:, 0, 5], J[:, 1, 5] = z, -y, x
    J[:, 1, 3], J[:, 2, 3], J[:, 2, 4] = -z, y, -x
    variance = max(float(np.mean(np.square(distance))), 1e-8)
    return np.asarray(np.einsum("nki,nkj->ij", J, J) / variance)
