# SPDX-License-Identifier: Apache-2.0
"""The registration of one shape upon another: every yaw, out of seen free space, to its basin, the best climbed."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.projection import FAST
from objreg_ros.registration.shapes.shape import Shape, upright_motion, upright_pose
from objreg_ros.registration.shapes.silhouette_score import climb, two_way, weights_of
from objreg_ros.registration.shapes.upright_icp import settle
from objreg_ros.registration.shapes.visual_hull import clear

COARSE_YAWS = 12  # yaws of a pair of objects among several: each 30 deg
COARSE_POINTS = 100  # points a side that rank such poses
YAWS = 16  # of a lone object's shape: each 22.5 deg, as a basin is wide
DEPTH_SHARE = 0.1  # how much deeper an object's middle lies than what is seen of it, in its widths
RANKING_POINTS = 100  # points a side by which poses are ranked before the best are refined
REFINED = 4  # poses of a pair of shapes
CLIMBED = 2  # best poses from which the score is climbed to its maximum
SCORE_MARGIN = 0.5  # below the best, beyond which a pose is not climbed
CLIMB_ROUNDS = 8  # most
SAME_TURN = 0.12  # rad within which two motions are one
SAME_SHIFT = 0.015  # m
ALIKE_TURN, CROWD = 0.5, 2  # rad within which motions turn alike, and how many of them are refined
CLIMB = (0.05, 0.012, 0.012, 0.0)  # rad and m: the first steps of a climb; a shape keeps its height
WIDEST_REACH = 0.07  # m within which a point finds a partner at first
CLEARED, CLEARED_COARSELY, CLEARED_AT_LAST = (100, 6), (50, 4), (200, 5)  # points a side and steps out of free space


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
    return _started(source.kernel_arrays, target.kernel_arrays, target.surface.grid, starts, *settling, cleared)


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
    moved, scores = _started(
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
    found, refined_scores = _finish(*arrays, motions, scores, extent, weights_of(), numbers, margin, reach)
    order = np.argsort(-refined_scores, kind="stable")
    poses = upright_pose(source, target, found[order])
    return [ScoredPose(T, score) for T, score in zip(poses, refined_scores[order].tolist(), strict=True)]


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _started(source, target, grid, starts, extent, weights, most, reach, cleared):  # type: ignore[no-untyped-def]
    """Each start brought to where it floats least, and from there to its basin: (motions (K, 4), scores (K,)).

    The latter only where both silhouettes score it no lower: opposite sides of an object have next to no surface in
    common, and would be drawn together.
    """
    motions, scores = starts.copy(), np.empty(len(starts))
    trial = np.empty(4)
    for k in range(len(starts)):
        clear(source, target, motions[k], *cleared)
        scores[k] = two_way(source, target, motions[k], extent, weights, most)
        trial[:] = motions[k]
        settle(source[0], source[1], most, grid, trial, reach, 0.4 * reach, 8)
        scores[k] = _better(source, target, trial, motions[k], scores[k], extent, weights, most)
    return motions, scores


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _better(source, target, trial, motion, score, extent, weights, most):  # type: ignore[no-untyped-def]
    """The higher of two scores, and in ``motion`` what has it: itself, or ``trial``."""
    found = two_way(source, target, trial, extent, weights, most)
    if found < score:
        return score
    motion[:] = trial
    return found


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _finish(  # type: ignore[no-untyped-def]
    source, target, grid, motions, scores, extent, weights, numbers, margin, reach
):
    """The best distinct motions, refined with every point, the first of them climbed: (motions, scores).

    What is below the best by more than ``margin`` is not climbed.
    """
    kept, climbed, rounds = numbers
    P, N = source[0], source[1]
    every, cell = len(P), grid[4]
    best, n, trial = np.empty((kept, 4)), 0, np.empty(4)
    order = np.empty(len(scores), np.int64)
    _rank(scores, order)
    for start in order:
        if n < kept and not _known(motions[start], best, n) and _crowd(motions[start], best, n) < CROWD:
            best[n] = motions[start]
            n += 1
    best, refined = best[:n], np.empty(n)
    for k in range(n):
        refined[k] = two_way(source, target, best[k], extent, weights, every)
        trial[:] = best[k]
        clear(source, target, trial, *CLEARED_AT_LAST)
        refined[k] = _better(source, target, trial, best[k], refined[k], extent, weights, every)
        trial[:] = best[k]
        settle(P, N, every, grid, trial, reach, max(1.5 * cell, 0.008), 12)
        refined[k] = _better(source, target, trial, best[k], refined[k], extent, weights, every)
    _rank(refined, order)
    top = refined[order[0]] if n else 0.0
    for k in order[: min(n, climbed)]:
        if refined[k] < top - margin:
            break
        refined[k] = climb(source, target, best[k], extent, weights, every, np.array(CLIMB), rounds)
        trial[:] = best[k]
        settle(P, N, every, grid, trial, max(1.5 * cell, 0.010), max(1.2 * cell, 0.006), 8)
        refined[k] = _better(source, target, trial, best[k], refined[k], extent, weights, every)
    return best, refined


@numba.njit(cache=True, nogil=True)
def _crowd(motion, others, n):  # type: ignore[no-untyped-def]
    """How many others turn about as far: what looks much the same after half a turn keeps places for both."""
    count = 0
    for k in range(n):
        turn = (motion[0] - others[k, 0] + np.pi) % (2.0 * np.pi) - np.pi
        if abs(turn) < ALIKE_TURN:
            count += 1
    return count


@numba.njit(cache=True, nogil=True)
def _rank(scores, order):  # type: ignore[no-untyped-def]
    """Fill ``order`` with the indices of scores, the highest first, by insertion: they are few."""
    for k in range(len(scores)):
        at = k
        while at > 0 and scores[order[at - 1]] < scores[k]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = k


@numba.njit(cache=True, nogil=True)
def _known(motion, others, n):  # type: ignore[no-untyped-def]
    for k in range(n):
        turn = (motion[0] - others[k, 0] + np.pi) % (2.0 * np.pi) - np.pi
        shift = abs(motion[1] - others[k, 1]) + abs(motion[2] - others[k, 2])
        if abs(turn) < SAME_TURN and shift < SAME_SHIFT:
            return True
    return False
