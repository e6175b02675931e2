# SPDX-License-Identifier: Apache-2.0
"""The focal length and the principal point of a camera, and its motion, from corners whose depth is known.

As a camera turns, the picture of a point moves by the focal length times the angle, and its depth changes by the angle
times how far aside it is, which is the depth times the pixels over the focal length. So both together give the focal
length, without any target: a bundle adjustment over pairs of views that share one camera (Triggs et al., "Bundle
adjustment: a modern synthesis", 2000), with the motions eliminated (Schur complement). The deviations are robust to
corners of one span that err together (sandwich).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import pose
from objreg_ros.plausibility.corner_tracks import Span
from objreg_ros.sensor import GAUSSIAN, TRACKING_SIGMA_GROWTH, TRACKING_SIGMA_M

CORNER_SIGMA_PX = 0.35  # of a corner that was followed, in pixels of the view
HUBER, CUTOFF = 2.0, 8.0  # deviations beyond which an error counts linearly, and not at all
FOCAL_PRIOR = 0.7  # deviation of the logarithm of the focal length
CENTRE_PRIOR = 0.1  # deviation of the principal point, of a side of the picture
MOST_STEP = 0.3  # of the logarithm of the focal length in one round
MOST_STEP_PX = 15.0
MOTIONS_FIRST, MOTIONS_LATER = 6, 2  # steps of the motions before each step of the camera
ROUNDS, SETTLED = 8, 1e-3
COARSE = 3  # rounds in which every span counts: with a camera that is far off none fits
LEAST_TRACE = 1e-6
MOST_MISFIT = 2.0  # of a span that counts: in others something moved, or corners slid along outlines
FEW = 5.0  # spans, of which the scatter of so few shows no more than half of their variance
MOST_POINTS = 40  # of a span

FOCAL_FLOOR = 0.015  # what a focal length errs by beyond what spans scatter: depth that is a little off, a lens
CENTRE_FLOOR = 0.012  # the same of a principal point, of the width of the picture


@dataclass(frozen=True, slots=True, eq=False)
class CameraFit:
    """What was measured of a camera: its focal length as a share ``focal`` of what it says, and its principal point
    ``centre (2,)`` beside what it says as a share of the width, with their deviations; the motions ``T_last_first (n,
    4, 4)`` of the spans with this camera, and how well each fits (``misfit (n,)``, 1 is as expected)."""

    count: int  # spans that fit
    focal: float
    focal_sigma: float  # of its logarithm
    centre: Array
    centre_sigma: Array
    T_last_first: Array
    misfit: Array


class _Corners(NamedTuple):
    """The corners of all spans, (n, p), with ``known`` where there is one."""

    uv_first: Array
    z_first: Array
    uv_last: Array
    z_last: Array
    known: Array

    @classmethod
    def of(cls, spans: Sequence[Span]) -> _Corners:
        most = min(MOST_POINTS, max(len(span.z_first) for span in spans))
        corners = cls(*(np.ones((len(spans), most, *rest)) for rest in ((2,), (), (2,), (), ())))
        corners.known[:] = 0.0
        for i, span in enumerate(spans):
            chosen = np.linspace(0, len(span.z_first) - 1, min(most, len(span.z_first))).astype(int)
            for column, values in zip(corners[:4], span[2:], strict=True):
                column[i, : len(chosen)] = values[chosen]
            corners.known[i, : len(chosen)] = 1.0
        return corners


def fit_camera(spans: Sequence[Span], camera: Intrinsics, near: CameraFit | None = None) -> CameraFit:
    """The camera by which the corners of ``spans`` move as rigid bodies do, beside ``camera`` of the views.

    ``near`` is an earlier fit to begin with. ValueError without spans.
    """
    if not spans:
        raise ValueError("expected spans of corners, got none")
    corners = _Corners.of(spans)
    size = np.array([camera.width, camera.height], float)
    stated = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    change = np.zeros(3) if near is None else np.array([np.log(near.focal), *(near.centre * camera.width)])
    prior = np.array([FOCAL_PRIOR, *(CENTRE_PRIOR * size)]) ** -2
    T = _rigid_motions(corners, _changed(stated, change))
    for turn in range(ROUNDS):
        fitted = _changed(stated, change)
        T = _fit_motions(corners, fitted, T, MOTIONS_FIRST if turn == 0 else MOTIONS_LATER)
        H, g, misfit = _reduced(corners, fitted, T)
        fits = (misfit < (MOST_MISFIT if turn >= COARSE else np.inf))[:, None]
        H, g = H * fits[..., None], g * fits
        information = H.sum(axis=0) + np.diag(prior)
        step = -np.linalg.solve(information, g.sum(axis=0) + prior * change)
        step = np.clip(step, [-MOST_STEP, -MOST_STEP_PX, -MOST_STEP_PX], [MOST_STEP, MOST_STEP_PX, MOST_STEP_PX])
        change = change + step
        if turn > COARSE and np.abs(step * [1.0, 0.01, 0.01]).max() < SETTLED:
            break
    covariance = _sandwich(H.sum(axis=0) + np.diag(prior), g)
    sigma = np.sqrt(np.diag(covariance)) / [1.0, size[0], size[0]]
    sigma = np.hypot(sigma, [FOCAL_FLOOR, CENTRE_FLOOR, CENTRE_FLOOR]) * _strain(misfit)
    return CameraFit(
        int(np.count_nonzero(fits)),
        float(np.exp(change[0])),
        float(sigma[0]),
        change[1:] / size[0],
        sigma[1:],
        T,
        misfit,
    )


def motions_as_stated(spans: Sequence[Span], camera: Intrinsics) -> Array:
    """The motions ``T_last_first (n, 4, 4)`` of spans, at least one, of a ``camera`` that is what it says."""
    corners, stated = _Corners.of(spans), np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    return _fit_motions(corners, stated, _rigid_motions(corners, stated), MOTIONS_FIRST)


def _changed(camera: Array, change: Array) -> Array:
    return np.array([*(camera[:2] * np.exp(change[0])), *(camera[2:] + change[1:])])


def _sandwich(information: Array, scores: Array) -> Array:
    """The covariance of an estimate whose scores (n, k) are those of so many independent spans; no less than the
    inverse of the information."""
    inverse = np.linalg.inv(information)
    count = max(1, int(np.count_nonzero(scores.any(axis=1))))
    robust = inverse @ (scores.T @ scores) @ inverse * (count + FEW) / count
    return np.diag(np.maximum(np.diag(robust), np.diag(inverse)))


def _rigid_motions(corners: _Corners, camera: Array) -> Array:
    """The motions (n, 4, 4) that align the first points of the spans with the last, by their singular values
    (Arun, Huang and Blostein, 1987). They are found twice: the second time without points that are far off."""
    first, last = (_points(uv, z, camera) for uv, z in ((corners.uv_first, corners.z_first), corners[2:4]))
    weight = corners.known
    for _ in range(2):
        T = _rigid_fits(first, last, weight)
        off = np.linalg.norm((T[:, None, :3, :3] @ first[..., None])[..., 0] + T[:, None, :3, 3] - last, axis=-1)
        off = np.where(corners.known > 0, off, np.nan)
        weight = corners.known * (np.nan_to_num(off, nan=np.inf) <= 2.0 * np.nanmedian(off, axis=1, keepdims=True))
    return _rigid_fits(first, last, weight)


def _points(uv: Array, z: Array, camera: Array) -> Array:
    """The points (n, p, 3) at pixels and depths."""
    return np.concatenate([(uv - camera[2:]) / camera[:2] * z[..., None], z[..., None]], axis=-1)


def _rigid_fits(source: Array, target: Array, weight: Array) -> Array:
    share = (weight / weight.sum(axis=1, keepdims=True))[..., None]
    middles = [(share * points).sum(axis=1) for points in (source, target)]
    spread = np.einsum("npi,npj->nij", share * (target - middles[1][:, None]), source - middles[0][:, None])
    U, _, Vt = np.linalg.svd(spread)
    U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    R = U @ Vt
    return pose(R, middles[1] - (R @ middles[0][..., None])[..., 0])


def _fit_motions(corners: _Corners, camera: Array, T: Array, steps: int) -> Array:
    """The motions (n, 4, 4) by so many steps of Gauss-Newton."""
    for _ in range(steps):
        errors, jacobian = _errors(corners, camera, T)
        H, g = _normal_equations(jacobian[..., :6], errors, corners.known)
        step = -np.linalg.solve(H + LEAST_TRACE * np.eye(6), g[..., None])[..., 0]
        T = pose(Rotation.from_rotvec(step[:, 3:]).as_matrix(), step[:, :3]) @ T
    return T


def _reduced(corners: _Corners, camera: Array, T: Array) -> tuple[Array, Array, Array]:
    """Information (n, 3, 3) and scores (n, 3) of the camera with the motions eliminated, and the misfit (n,)."""
    errors, J = _errors(corners, camera, T)
    H, g = _normal_equations(J, errors, corners.known)
    eliminated = np.linalg.solve(H[:, :6, :6] + LEAST_TRACE * np.eye(6), H[:, :6, 6:]).transpose(0, 2, 1)
    reduced = H[:, 6:, 6:] - eliminated @ H[:, :6, 6:]
    scores = g[:, 6:] - (eliminated @ g[:, :6, None])[..., 0]
    return reduced, scores, _misfit(np.abs(errors), corners.known)


def _normal_equations(J: Array, errors: Array, known: Array) -> tuple[Array, Array]:
    """``J^T W J`` (n, k, k) and ``J^T W e`` (n, k) of robust weights."""
    rows = J.reshape(len(J), -1, J.shape[-1])
    weighted = (rows * _weights(errors, known).reshape(len(J), -1, 1)).transpose(0, 2, 1)
    return weighted @ rows, (weighted @ errors.reshape(len(J), -1, 1))[..., 0]


def _strain(misfit: Array) -> float:
    """By how much more than expected the spans that count are off, all together."""
    counted = misfit[misfit < MOST_MISFIT]
    return max(1.0, float(np.median(counted))) if len(counted) else 1.0


def _misfit(size: Array, known: Array) -> Array:
    """The deviation (n,) of errors of a size (n, p, 3), by their median."""
    return np.asarray(np.nanmedian(np.where(known[..., None] > 0, size, np.nan), axis=(1, 2))) / GAUSSIAN


def _weights(errors: Array, known: Array) -> Array:
    """Huber's, and none beyond `CUTOFF`; of a span that does not fit yet in its own deviations."""
    size = np.abs(errors)
    size = size / np.maximum(1.0, _misfit(size, known))[:, None, None]
    return known[..., None] * (size < CUTOFF) / np.maximum(1.0, size / HUBER)


def _errors(corners: _Corners, camera: Array, T: Array) -> tuple[Array, Array]:
    """Errors (n, p, 3) of column, row and depth in deviations, and their derivatives (n, p, 3, 9) by a motion that
    multiplies from the left (translation, rotation), by the logarithm of the focal length and by the principal point.
    """
    f, c = camera[:2], camera[2:]
    z_first = corners.z_first
    seen = _points(corners.uv_first, z_first, camera)
    R = T[:, None, :3, :3]
    there = (R @ seen[..., None])[..., 0] + T[:, None, :3, 3]
    x, y, z = np.moveaxis(there, -1, 0)
    z = np.maximum(z, 0.05)
    moved = np.zeros((*z.shape, 3, 9))
    moved[..., 0, 0] = moved[..., 1, 1] = moved[..., 2, 2] = 1.0
    moved[..., 0, 4], moved[..., 0, 5] = z, -y
    moved[..., 1, 3], moved[..., 1, 5] = -z, x
    moved[..., 2, 3], moved[..., 2, 4] = y, -x
    by_camera = np.zeros((*z.shape, 3, 3))
    by_camera[..., 0, 0], by_camera[..., 1, 0] = -seen[..., 0], -seen[..., 1]
    by_camera[..., 0, 1], by_camera[..., 1, 2] = -z_first / f[0], -z_first / f[1]
    moved[..., 6:] = R @ by_camera
    sigma_z = np.hypot(_depth_sigma(z_first), _depth_sigma(corners.z_last))
    J = np.empty_like(moved)
    for k, side in enumerate((x, y)):
        J[..., k, :] = f[k] / z[..., None] * (moved[..., k, :] - (side / z)[..., None] * moved[..., 2, :])
        J[..., k, 6] += f[k] * side / z
        J[..., k, 7 + k] += 1.0
    J[..., :2, :] /= CORNER_SIGMA_PX
    J[..., 2, :] = moved[..., 2, :] / sigma_z[..., None]
    uv = there[..., :2] / z[..., None] * f + c
    pixels = (uv - corners.uv_last) / CORNER_SIGMA_PX
    depths = (there[..., 2] - corners.z_last) / sigma_z
    return np.concatenate([pixels, depths[..., None]], axis=-1), J


def _depth_sigma(z: Array) -> Array:
    return TRACKING_SIGMA_M + TRACKING_SIGMA_GROWTH * z * z
