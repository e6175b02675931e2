# SPDX-License-Identifier: Apache-2.0
"""Poses from putative matches of oriented points, by consensus of pairs: exhaustive, so it needs no luck and no seed.

Two matches fix a pose when a direction is known beside their baseline: gravity where both frames know it, the sum of
their normals otherwise. Every pair of matches that keeps its length, its tilt and its normals gives one pose, and
the pose is scored by the weight of all matches that it brings together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.registration.kernels.same_pose import VOTES_ANGLE, VOTES_TOLERANCES, Nearness, distinct

_KERNELS = kernels("pose_voting")
MOST_PAIRS = 4000  # of matches that agree, each of which gives a pose to weigh


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matches:
    """M putative matches: points and normals (M, 3) float64 in source and target, 0 0 0 if unknown; weights (M,)."""

    source: Array
    target: Array
    source_normals: Array
    target_normals: Array
    weights: Array

    def __len__(self) -> int:
        return len(self.weights)


def poses(
    matches: Matches,
    up_source: Array | None,
    up_target: Array | None,
    tolerance: float,
    shortest: float,
    limit: int,
) -> tuple[tuple[Array, float], ...]:
    """The best distinct poses T_target_source with their support, best first, at most ``limit``.

    ``up_*`` are unit vectors against gravity or None; ``tolerance`` m of a match; ``shortest`` m of a baseline.
    Nothing comes back when no two matches agree.
    """
    upright = up_source is not None and up_target is not None
    ups = (up_source, up_target) if upright else (np.zeros(3), np.zeros(3))
    arrays = (matches.source, matches.target, matches.source_normals, matches.target_normals)
    pairs = _KERNELS.consistent_pairs(*arrays, *ups, upright, tolerance, shortest, MOST_PAIRS)
    if len(pairs) == 0:
        return ()
    T = _KERNELS.poses(*arrays, *ups, upright, pairs)
    columns = (np.ascontiguousarray(part.T, np.float32) for part in (matches.source, matches.target, matches.weights))
    support = _KERNELS.support(*columns, T.astype(np.float32), np.float32(tolerance))
    middle = matches.source.mean(axis=0)
    chosen = distinct(T, support, middle, limit, Nearness(VOTES_ANGLE, VOTES_TOLERANCES * tolerance))
    return tuple((T[k], float(support[k])) for k in chosen)
