# SPDX-License-Identifier: Apache-2.0
"""The registration of one shape upon another: every yaw, out of seen free space, to its basin, the best climbed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.registration.shapes.shape import Shape, upright_motion, upright_pose
from objreg_ros.registration.shapes.silhouette_score import weights_of

_KERNELS = kernels("upright_search")
COARSE_YAWS = 12  # yaws of a pair of objects among several: each 30 deg
COARSE_POINTS = 100  # points a side that rank such poses
YAWS = 16  # of a lone object's shape: each 22.5 deg, as a basin is wide
DEPTH_SHARE = 0.1  # how much deeper an object's middle lies than what is seen of it, in its widths
RANKING_POINTS = 100  # points a side by which poses are ranked before the best are refined
REFINED = 4  # poses of a pair of shapes
CLIMBED = 2  # best poses from which the score is climbed to its maximum
SCORE_MARGIN = 0.5  # below the best, beyond which a pose is not climbed
CLIMB_ROUNDS = 8  # most
WIDEST_REACH = 0.07  # m within which a point finds a partner at first
CLEARED, CLEARED_COARSELY = (100, 6), (50, 4)  # points a side and steps out of free space


class ScoredPose(NamedTuple):
    """A pose of one shape upon another and what both silhouettes say of it; a higher score is better."""

    T_target_source: Array
    score: float


def register_shapes(source: Shape, target: Shape) -> list[ScoredPose]:
    """The best distinct poses of ``source`` upon ``target``, both upright on what they stand on, best first."""
    motions, scores = _begun(source, target, YAWS, CLEARED, RANKING_POINTS)
    return _finished(source, target, motions, scores, 0.5 * _reach(source, target))


def coarse_poses(source: Shape, target: Shape, most: int) -> list[Array]:
    """The poses of ``source`` upon ``target`` that look best at first, at most so many: a tenth of a registration."""
    motions, scores = _begun(source, target, COARSE_YAWS, CLEARED_COARSELY, COARSE_POINTS)
    return list(upright_pose(source, target, motions[np.argsort(-scores, kind="stable")[:most]]))


def _begun(source: Shape, target: Shape, yaws: int, cleared: tuple[int, int], sample: int) -> tuple[Array, Array]:
    extent = 0.5 * (source.extent + target.extent)
    starts = _starts(yaws, DEPTH_SHARE * extent)
    settling = extent, weights_of(), sample, _reach(source, target)
    return _KERNELS.started(source.kernel_arrays, target.kernel_arrays, target.surface.grid, starts, *settling, cleared)


def _reach(source: Shape, target: Shape) -> float:
    return min(WIDEST_REACH, 0.25 * (source.extent + target.extent))


def improve(source: Shape, target: Shape, poses: Array) -> list[ScoredPose]:
    """Poses (K, 4, 4) of ``source`` near ``target``, made upright and brought to where both silhouettes score them
    best.

    The best distinct ones come back, best first.
    """
    motions = upright_motion(source, target, poses)
    extent = 0.5 * (source.extent + target.extent)
    settling = extent, weights_of(), RANKING_POINTS, WIDEST_REACH
    moved, scores = _KERNELS.started(
        source.kernel_arrays, target.kernel_arrays, target.surface.grid, motions, *settling, CLEARED
    )
    return _finished(source, target, moved, scores, 0.5 * WIDEST_REACH)


def _starts(yaws: int, deeper: float) -> Array:
    """Motions (K, 4) of every yaw; both cameras look along x, and the unseen middle lies so much deeper, in m."""
    yaw = 2.0 * np.pi * np.arange(yaws) / yaws
    return np.stack([yaw, deeper - np.cos(yaw) * deeper, -np.sin(yaw) * deeper, np.zeros_like(yaw)], axis=1)


def _finished(source: Shape, target: Shape, motions: Array, scores: Array, reach: float) -> list[ScoredPose]:
    extent = 0.5 * (source.extent + target.extent)
    numbers, margin = (REFINED, CLIMBED, CLIMB_ROUNDS), SCORE_MARGIN
    arrays = source.kernel_arrays, target.kernel_arrays, target.surface.grid
    found, refined_scores = _KERNELS.finish(*arrays, motions, scores, extent, weights_of(), numbers, margin, reach)
    order = np.argsort(-refined_scores, kind="stable")
    poses = upright_pose(source, target, found[order])
    return [ScoredPose(T, score) for T, score in zip(poses, refined_scores[order].tolist(), strict=True)]
