# SPDX-License-Identifier: Apache-2.0
"""The total score of an upright pose, of the views and of the objects' silhouettes, and its climb.

Objects that share next to nothing between two views are held by their silhouettes to some degrees only, or drawn
together; the views fix the rest, and from far away: V rises over 20 degrees and 3 cm towards the true pose.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.least_squares import invert
from objreg_ros.registration.kernels.projection import FAST
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.prepare.views import Sight
from objreg_ros.registration.score.free_space import SEEN, VIOLATIONS, count
from objreg_ros.registration.score.view_score import RANKING_POINTS, rated_quickly
from objreg_ros.registration.shapes.shape import Shape
from objreg_ros.registration.shapes.silhouette_score import two_way, weights_of
from objreg_ros.sensor import depth_tolerance

SILHOUETTE_WEIGHT_UPRIGHT = 1.0  # of the silhouette score, beside V, when upright poses are compared
VIOLATION_WEIGHT_UPRIGHT = 5.0  # of violations, beyond their weight in V: an upright pose has no tilt to excuse them
CLIMB_POINTS = 120  # a side, of objects and of views, by which an upright pose is climbed
CLIMB_TURNS_DEG = (3.0, 6.0, 10.0, 15.0, 20.0, 25.0)  # about the objects, either way, with which a climb may begin
STEPS = (0.08, 0.015)  # rad and m: the first of a climb
LAST = 0.12  # of them: the shortest
ROUNDS = 10
GAIN = 0.004  # of score that a step must bring


class TotalScore:
    """The total score of upright motions (yaw, x, y, rise) of shape ``a`` of source upon ``b`` of target."""

    def __init__(self, source: Prepared, target: Prepared, a: Shape, b: Shape) -> None:
        slops = depth_tolerance(source.sight.noise, target.sight.noise)
        textured = source.sight.textured and target.sight.textured
        weights = np.array([*weights_of(), SILHOUETTE_WEIGHT_UPRIGHT, VIOLATION_WEIGHT_UPRIGHT])
        self._pair = (_image(source.sight), _image(target.sight), slops, textured), a.kernel_arrays, b.kernel_arrays
        self._extent, self._weights = 0.5 * (a.extent + b.extent), weights
        self._sample, self._few = RANKING_POINTS, CLIMB_POINTS
        self._turns = np.radians([0.0, *CLIMB_TURNS_DEG, *(-turn for turn in CLIMB_TURNS_DEG)])

    def of(self, motions: Array) -> Array:
        """The total scores (K,) of motions (K, 4)."""
        return np.asarray(_total_scores(*self._pair, motions, self._extent, self._weights, self._sample))

    def climbed(self, motion: Array) -> Array:
        """The motion (4,) brought to where its total score is highest.

        It is turned first, to where its view score is best: out of what the objects alone are content with.
        """
        return np.asarray(_climbed(*self._pair, motion.copy(), self._turns, self._extent, self._weights, self._few))


def _image(sight: Sight) -> tuple[Any, ...]:
    return sight.points, sight.shades, (sight.near, sight.far, sight.detail, sight.camera)


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _total_scores(views, source, target, motions, extent, weights, most):  # type: ignore[no-untyped-def]
    found = np.empty(len(motions))
    for k in range(len(motions)):
        found[k] = _total_score(views, source, target, motions[k], extent, weights, most)
    return found


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _climbed(views, source, target, motion, turns, extent, weights, most):  # type: ignore[no-untyped-def]
    best, trial = -np.inf, motion.copy()
    for turn in turns:
        trial[0] = motion[0] + turn
        seen = _view_score(views, source, target, trial, weights[-1], most)
        if seen > best:
            best, yaw = seen, trial[0]
    motion[0] = yaw
    best = _total_score(views, source, target, motion, extent, weights, most)
    angle, shift = STEPS
    for _ in range(ROUNDS):
        improved = False
        for k in range(6):
            trial[:] = motion
            trial[k // 2] += (angle if k < 2 else shift) * (1.0 if k % 2 == 0 else -1.0)
            found = _total_score(views, source, target, trial, extent, weights, most)
            if found > best + GAIN:
                best, improved = found, True
                motion[:] = trial
        if not improved:
            angle, shift = 0.5 * angle, 0.5 * shift
            if angle < LAST * STEPS[0]:
                break
    return motion


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _total_score(views, source, target, motion, extent, weights, most):  # type: ignore[no-untyped-def]
    """The view score, and the weighed silhouette score of the objects, -1 to 1."""
    alike = two_way(source, target, motion, extent, weights[:-2], most)
    return _view_score(views, source, target, motion, weights[-1], most) + weights[-2] * max(-1.0, min(1.0, alike))


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _view_score(views, source, target, motion, violated, most):  # type: ignore[no-untyped-def]
    """V of an upright motion, less what is in seen free space once more: an upright pose has no tilt to excuse it."""
    (points, shades, image), (others, their_shades, their_image), slops, textured = views
    T, back = _poses(source, target, motion)
    near, far, detail, camera = their_image
    forward = count(points[:most], shades[:most], T, near, far, detail, camera, slops[0], slops[1])
    near, far, detail, camera = image
    backward = count(others[:most], their_shades[:most], back, near, far, detail, camera, slops[0], slops[1])
    asked = min(most, len(points)) + min(most, len(others))
    floating = max(forward[VIOLATIONS] / max(forward[SEEN], 1.0), backward[VIOLATIONS] / max(backward[SEEN], 1.0))
    return rated_quickly(forward, backward, textured, asked) - violated * floating


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _poses(source, target, motion):  # type: ignore[no-untyped-def]
    """The pose (4, 4) of the source's camera in the target's under an upright motion, and its inverse."""
    R_source, origin, R_target, other_origin = source[3], source[4], target[3], target[4]
    c, s = np.cos(motion[0]), np.sin(motion[0])
    turned, shift = np.empty((3, 3)), np.empty(3)
    for k in range(3):
        turned[0, k] = c * R_source[0, k] - s * R_source[1, k]
        turned[1, k] = s * R_source[0, k] + c * R_source[1, k]
        turned[2, k] = R_source[2, k]
    shift[0] = motion[1] + other_origin[0] - c * origin[0] + s * origin[1]
    shift[1] = motion[2] + other_origin[1] - s * origin[0] - c * origin[1]
    shift[2] = motion[3] + other_origin[2] - origin[2]
    T, back = np.eye(4), np.eye(4)
    for i in range(3):
        T[i, 3] = 0.0
        for j in range(3):
            T[i, j] = 0.0
            for k in range(3):
                T[i, j] += R_target[k, i] * turned[k, j]
            T[i, 3] += R_target[j, i] * shift[j]
    invert(T, back)
    return T, back
