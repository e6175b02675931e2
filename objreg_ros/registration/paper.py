# SPDX-License-Identifier: Apache-2.0
"""The founding method, selectable as ``method: paper``: pairwise point-to-point ICP of objects of one label.

Besl and McKay, "A method for registration of 3-D shapes" (1992), by Open3D: nearest neighbours from a kd-tree, pairs
rejected by distance, the motion from the singular value decomposition, from rest, until it settles. Open3D does not
thin pairs to one-to-one, so the evidence does, after the last step. The method answers to the same gate as every other
method, with the same evidence.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from objreg_ros import extra
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Alignment
from objreg_ros.geometry import transform
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.engine import merged
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.prepare.prepared_cache import PreparedCache
from objreg_ros.registration.propose.evidence import gather, perturbation_margin_of

PAIR_DISTANCE_M = 0.1  # pairs of points farther apart are rejected
ITERATIONS = 100  # most
TOLERANCE_M = 1e-06  # change of the root mean square distance that ends the iterations
LEAST_PAIRS = 6
FITNESS_TOLERANCE = 1e-6  # share of the points that find a partner: its change that counts as none, Open3D's default


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Icp:
    """A pose, the indices ``pairs (K, 2)`` of source and target under it, and whether a further step changes none."""

    T_target_source: Array
    pairs: Array
    converged: bool


class PaperEngine:
    """Proposes a pose for each pair of objects of one label; the counterpart of `Engine`."""

    def __init__(self, params: RegistrationParams) -> None:
        extra.load("open3d", "paper", "method: paper")  # now and not with the first pair: it takes seconds
        self._cache = PreparedCache(params)

    def prepare(self, keyframe: Keyframe) -> None:
        """Make a keyframe ready, before several threads propose poses of it."""
        self._cache.get(keyframe)

    def propose(
        self, source: Keyframe, target: Keyframe, T_target_source_prior: Array | None = None
    ) -> tuple[Candidate, ...]:
        """Poses of ``source`` in ``target``, the best verified first. ICP starts from rest, never from a prior."""
        alignments = [
            register(a.cloud.xyz, b.cloud.xyz, np.eye(4))
            for a in source.objects
            for b in target.objects
            if a.label == b.label
        ]
        pair = self._cache.get(source), self._cache.get(target)
        found = [self._candidate(*pair, alignment) for alignment in alignments if alignment is not None]
        return tuple(merged(found, pair[0].middle))

    def _candidate(self, source: Prepared, target: Prepared, alignment: Alignment) -> Candidate:
        candidate = gather(source, target, alignment, ("paper",))
        return replace(candidate, perturbation_margin=perturbation_margin_of(candidate, source, target))


def register(source: Array, target: Array, T_target_source: Array) -> Alignment | None:
    """Point-to-point ICP of points (N, 3) upon (M, 3) from a start; None where too few points correspond."""
    source, target = source.astype(float), target.astype(float)
    if min(len(source), len(target)) < LEAST_PAIRS:
        return None
    found = _icp(source, target, T_target_source)
    moved = transform(found.T_target_source, source)
    distance = np.linalg.norm(moved[found.pairs[:, 0]] - target[found.pairs[:, 1]], axis=1)
    kept = _one_to_one(found.pairs, distance)
    if len(kept) < LEAST_PAIRS:
        return None
    paired, distance = found.pairs[kept, 0], distance[kept]
    return Alignment(
        T_target_source=found.T_target_source,
        information=_information(source[paired], found.T_target_source, distance),
        inliers=len(paired),
        overlap=len(paired) / len(source),
        rmse=float(np.sqrt(np.mean(np.square(distance)))),
        converged=found.converged,
        middle=moved.mean(axis=0),
    )


def _icp(source: Array, target: Array, T_target_source: Array) -> _Icp:
    """Open3D's ICP. It does not say whether it settled, so one more step says it."""
    import open3d as o3d

    registration = o3d.pipelines.registration
    clouds = [o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz)) for xyz in (source, target)]

    def after(start: Array, iterations: int) -> Any:
        criteria = registration.ICPConvergenceCriteria(FITNESS_TOLERANCE, TOLERANCE_M, iterations)
        method = registration.TransformationEstimationPointToPoint()
        return registration.registration_icp(*clouds, PAIR_DISTANCE_M, start, method, criteria)

    last = after(T_target_source, ITERATIONS)
    further = after(last.transformation, 1)
    converged = (
        abs(further.fitness - last.fitness) < FITNESS_TOLERANCE
        and abs(further.inlier_rmse - last.inlier_rmse) < TOLERANCE_M
    )
    pairs = np.array(last.correspondence_set, int).reshape(-1, 2)
    return _Icp(
        T_target_source=np.array(last.transformation), pairs=pairs[np.argsort(pairs[:, 0])], converged=converged
    )


def _one_to_one(pairs: Array, distance: Array) -> Array:
    """The rows of ``pairs (K, 2)`` that stay: of the points that share a target the closest keeps it."""
    order = np.lexsort((distance, pairs[:, 1]))
    return order[np.unique(pairs[order, 1], return_index=True)[1]]


def _information(source: Array, T: Array, distance: Array) -> Array:
    """``J^T J / sigma^2`` of the point-to-point errors, for a step [t r] in the target's axes about the camera."""
    x, y, z = (source @ T[:3, :3].T).T
    J = np.zeros((len(source), 3, 6))
    J[:, :, :3] = np.eye(3)
    J[:, 0, 4], J[:, 0, 5], J[:, 1, 5] = z, -y, x
    J[:, 1, 3], J[:, 2, 3], J[:, 2, 4] = -z, y, -x
    variance = max(float(np.mean(np.square(distance))), 1e-8)
    return np.asarray(np.einsum("nki,nkj->ij", J, J) / variance)
