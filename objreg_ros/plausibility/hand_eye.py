# SPDX-License-Identifier: Apache-2.0
"""Where a camera sits on a body, and how long its metres are: hand-eye calibration, A X = X B of their motions.

Rotations first, by their axes (Park and Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group",
1994) together with the directions of travel, which a robot that turns about the vertical alone needs. Then all at once
by robust least squares. What the motions leave open, as the height of a camera on a level robot, stays near zero, and
its deviation says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, rotation_from_vector

TURN_SIGMA, TURN_GROWTH = np.radians(0.5), 0.03  # of a measured turn, and its growth with it
SHIFT_SIGMA_M, SHIFT_GROWTH = 0.01, 0.03  # of a measured shift, and its growth with it
LEVER_PRIOR_M = 0.5  # cameras sit within so much of the middle of a robot, more or less
SCALE_PRIOR = 1.0  # deviation of the logarithm of the scale
SCALE_FLOOR = 0.015  # what a scale errs by beyond what motions scatter: wheels, and depth that is a little off
FEW = 4.0  # motions, of which the scatter of so few shows no more than half of their variance
STARTS = 2  # rotations that a solution is sought from, the best first


@dataclass(frozen=True, slots=True, eq=False)
class HandEye:
    """``T_body_camera (4, 4)`` and by how much the camera's metres are longer than the body's (``scale``).

    ``rotation_sigma_deg`` is the largest deviation of the rotation, ``lever_sigma_m (3,)`` that of the position along
    the axes of the body, ``scale_sigma`` that of the scale's logarithm. ``rest`` is what is left, in deviations.
    """

    T_body_camera: Array
    scale: float
    rotation_sigma_deg: float
    lever_sigma_m: Array
    scale_sigma: float
    rest: float


def turns_of(T: Array) -> Array:
    """The rotation vectors (n, 3) of motions (n, 4, 4), rad."""
    return np.asarray(Rotation.from_matrix(T[:, :3, :3]).as_rotvec())


def hand_eye(T_body: Array, T_camera: Array, T_body_camera: Array | None = None) -> HandEye:
    """The mount by the motions (n, 4, 4) from the start to the end of each span, of the body and of the camera.

    Where ``T_body_camera`` is known, it is kept, and only the scale is measured.
    """
    motions = _Motions(T_body, T_camera)
    if T_body_camera is not None:
        return _known(motions, T_body_camera)
    starts = sorted(_starts(motions), key=lambda R: float(np.abs(motions.errors(np.zeros(7), R)).sum()))
    return min((_solve(motions, R) for R in starts[:STARTS]), key=lambda solution: solution[0])[1]


def _known(motions: _Motions, T_body_camera: Array) -> HandEye:
    scale = scale_of(*motions.shifts_of_camera(T_body_camera))
    return HandEye(T_body_camera, scale.factor, 0.0, np.zeros(3), scale.sigma, scale.rest)


class Scale(NamedTuple):
    """By what ``factor`` shifts are longer than others, the deviation of its logarithm, and what is left, in
    deviations."""

    factor: float
    sigma: float
    rest: float


def scale_of(shifts: Array, others: Array) -> Scale:
    """How much longer ``shifts (n, 3)`` are than ``others``. Both err: by the others they come out too short, the
    others by them too long (regression dilution; Fuller, "Measurement error models", 1987). The scale is between."""
    forward, backward = _ratio(others, shifts), _ratio(shifts, others)
    middle, between = 0.5 * (forward.log - backward.log), 0.5 * abs(forward.log + backward.log)
    sigma = float(np.linalg.norm([0.5 * (forward.sigma + backward.sigma), between, SCALE_FLOOR]))
    return Scale(float(np.exp(middle)), sigma, min(forward.rest, backward.rest))


class _Ratio(NamedTuple):
    log: float
    sigma: float
    rest: float


def _ratio(sources: Array, targets: Array) -> _Ratio:
    """How many times as long targets are as sources, by robust least squares of what the targets are off."""
    sigma = SHIFT_SIGMA_M + SHIFT_GROWTH * np.linalg.norm(targets, axis=1, keepdims=True)

    def errors(log_scale: Array) -> Array:
        return np.asarray((targets - sources * np.exp(log_scale)) / sigma).ravel()

    fit = least_squares(errors, [0.0], loss="soft_l1", bounds=(-4.0, 4.0))
    left = errors(fit.x)
    variance = _covariance(fit.jac, left, len(targets), np.array([SCALE_PRIOR]))[0, 0]
    return _Ratio(float(fit.x[0]), float(np.sqrt(variance)), float(np.median(np.abs(left))))


def _solve(motions: _Motions, R: Array) -> tuple[float, HandEye]:
    """The cost and the solution from one start of the rotation."""
    prior = np.array([1e3, 1e3, 1e3, *[LEVER_PRIOR_M] * 3, SCALE_PRIOR])

    def errors(x: Array) -> Array:
        return np.concatenate([motions.errors(x, R).ravel(), x / prior])

    fit = least_squares(errors, np.zeros(7), loss="soft_l1", max_nfev=50)
    own = 6 * motions.count
    covariance = _covariance(fit.jac[:own], errors(fit.x)[:own], motions.count, prior)
    found = pose(rotation_from_vector(fit.x[:3]) @ R, fit.x[3:6])
    rest = float(np.median(np.abs(errors(fit.x)[:own])))
    rotation_sigma = float(np.degrees(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1])))
    scale = scale_of(*motions.shifts_of_camera(found))
    scale_sigma = max(scale.sigma, float(np.sqrt(covariance[6, 6])))
    levers = np.sqrt(np.diag(covariance)[3:6])
    return float(fit.cost), HandEye(found, scale.factor, rotation_sigma, levers, scale_sigma, rest)


class _Motions:
    """The motions of body and camera, with what of them does not change with the mount."""

    def __init__(self, T_body: Array, T_camera: Array) -> None:
        self.count = len(T_body)
        self.turns = turns_of(T_body), turns_of(T_camera)
        self.shifts = T_body[:, :3, 3], T_camera[:, :3, 3]
        self._levers = T_body[:, :3, :3] - np.eye(3)
        turn, shift = (np.linalg.norm(vectors, axis=1, keepdims=True) for vectors in (self.turns[0], self.shifts[0]))
        self._turn_sigma = TURN_SIGMA + TURN_GROWTH * turn
        self._shift_sigma = SHIFT_SIGMA_M + SHIFT_GROWTH * shift

    def shifts_of_camera(self, T_body_camera: Array) -> tuple[Array, Array]:
        """The shifts (n, 3) of the camera as it was seen to move, and as the body's motion gives them."""
        R, lever = T_body_camera[:3, :3], T_body_camera[:3, 3]
        return self.shifts[1], (self._levers @ lever + self.shifts[0]) @ R

    def errors(self, x: Array, R: Array) -> Array:
        """Errors (n, 6) in deviations, of turns and of shifts, for a change of the rotation ``R`` (3), a lever (3) and
        the logarithm of the scale."""
        R = rotation_from_vector(x[:3]) @ R
        turn = self.turns[0] - self.turns[1] @ R.T
        shift = self._levers @ x[3:6] + self.shifts[0] - self.shifts[1] @ R.T * np.exp(-x[6])
        return np.hstack([turn / self._turn_sigma, shift / self._shift_sigma])


def _covariance(jacobian: Array, errors: Array, count: int, prior: Array) -> Array:
    """The covariance by so many motions that err by themselves, no less than what their own deviations come to."""
    inverse = np.linalg.inv(jacobian.T @ jacobian + np.diag(prior**-2.0))
    scores = np.einsum("nki,nk->ni", jacobian.reshape(count, -1, jacobian.shape[1]), errors.reshape(count, -1))
    robust = inverse @ (scores.T @ scores) @ inverse * (count + FEW) / count
    more = np.sqrt(np.maximum(np.diag(robust) / np.diag(inverse), 1.0))
    return inverse * np.outer(more, more)


def _starts(motions: _Motions) -> list[Array]:
    """Rotations to begin with: by turns and directions of travel, by each of them, and that of a camera forward."""
    turns, shifts = motions.turns, motions.shifts
    both = [np.vstack([turn / TURN_SIGMA, shift / SHIFT_SIGMA_M]) for turn, shift in zip(turns, shifts, strict=True)]
    forward = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    return [best_rotation(*both), best_rotation(*turns), best_rotation(*shifts), forward]


def best_rotation(targets: Array, sources: Array) -> Array:
    """The rotation (3, 3) that brings vectors (n, 3) closest to others (Wahba, 1965), twice: the farthest count no
    more in the second round."""
    kept = np.ones(len(targets), bool)
    for _ in range(2):
        U, _, Vt = np.linalg.svd(targets[kept].T @ sources[kept])
        R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
        off = np.linalg.norm(targets - sources @ R.T, axis=1)
        kept = off <= 2.0 * np.median(off)
    return np.asarray(R)
