# SPDX-License-Identifier: Apache-2.0
"""The last step of a registration: 6 DoF on all that was seen, what that is worth, and where it may still slide.

Our own refinement, because a GICP of small_gicp after it (3 cm voxels, 13 ms) makes the views agree less: over 63 pairs
of real keyframes the median V falls from 0.75 to 0.59 and the share within 5 degrees and 10 cm from 0.95 to 0.92; kept
only where V does not fall, it changes one pair.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Alignment, Array
from objreg_ros.geometry import skew, transform
from objreg_ros.registrar.contradiction import information, warped
from objreg_ros.registrar.direct import finish
from objreg_ros.registrar.icp import Fit, align, fit
from objreg_ros.registrar.liking import gain, liked
from objreg_ros.registrar.objects import explain
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Prepared
from objreg_ros.registrar.sliding import resisted

LITTLE = 0.02  # gain after which another round is not worth its time


def settle(source: Prepared, target: Prepared, T_target_source: Array, params: RegistrarParams) -> tuple[Array, Array]:
    """Poses (K, 4, 4) in their basins, brought to where the whole shape holds them, and whether it does (K,)."""
    _, reach, last = params.reaches
    T, share, _ = align(source.xyz, source.normals, target.surface, T_target_source, reach, last, params.iterations)
    return T, share * len(source.xyz) >= params.min_points


def refine(source: Prepared, target: Prepared, T_target_source: Array, params: RegistrarParams) -> Alignment:
    """Finish a settled pose; ``converged`` is False where next to nothing holds it.

    Grey has its say, and keeps it where views and objects like the pose no less. The information is that of patches of
    surface, because neighbouring points err together.
    """
    T, grey = _finished(source, target, T_target_source, params)
    found = fit(source.xyz, source.normals, target.surface, T, params.reaches[-1])
    loose = slack(found._replace(H=found.H + grey), T, transform(T, source.middle), params.slack_share)
    free, held = resisted(source, target, T, loose, found.extent, params)
    return Alignment(
        T_target_source=T,
        information=about_camera(information(source.xyz, source.normals, target.surface, T, params), T),
        inliers=found.inliers,
        overlap=found.inliers / max(1, len(source.xyz)),
        rmse=found.rmse,
        converged=found.inliers >= params.min_points,
        slack=free,
        held=held,
        middle=transform(T, source.middle),
    )


def _finished(source: Prepared, target: Prepared, T: Array, params: RegistrarParams) -> tuple[Array, Array]:
    """The pose after grey had its say, and what grey adds to its information: nothing where it does not correlate.

    Again while views and objects like it clearly better (`liking`), since each round sees more of the other view; the
    pose as it was, where they like it less: views that share little may like a pose a hair better that is centimetres
    off, and the objects then look less alike.
    """
    held = np.zeros((6, 6))
    if not (source.sight.textured and target.sight.textured):
        return T, held
    explained, _ = explain(source, target, T, params)
    best = liked(source, target, T, explained, params)
    for _ in range(params.grey_rounds):
        finished, grey = finish(source, target, T, params)
        found = liked(source, target, finished, explained, params)
        gained = gain(found, best, params)
        if gained < 0.0:
            break
        best, T = found, finished
        held = grey if (found.seen.texture or 0.0) >= params.holding_texture else np.zeros((6, 6))
        if gained < LITTLE:
            break
    return T, held


def about_camera(H: Array, T_target_source: Array) -> Array:
    """The information of a left step [t r], which turns about the target camera, as that of the source camera's pose.

    ROS poses with covariance mean the latter: translation of the child's origin, rotation about it, fixed axes.
    """
    A = np.eye(6)
    A[:3, 3:] = skew(T_target_source[:3, 3])
    return np.asarray(A.T @ H @ A)


def warp(source: Prepared, target: Prepared, T_target_source: Array, params: RegistrarParams) -> Array:
    """The covariance (6, 6) [t r] of the source camera's pose that a warped depth makes, in the target's axes."""
    C = warped(source.xyz, source.normals, target.surface, T_target_source, params)
    A = np.eye(6)
    A[:3, 3:] = -skew(T_target_source[:3, 3])
    return np.asarray(A @ C @ A.T)


def slack(found: Fit, T_target_source: Array, middle: Array, least_share: float) -> Array:
    """Unit directions (K, 6) [t r] of the source camera's pose that less than ``least_share`` of the surface resists.

    The motion is looked at about the ``middle (3,)`` of what was seen, with rotations scaled by its extent, so that a
    turn and a shift are comparable. A wall alone leaves three, a corridor one, a room none.
    """
    if found.inliers == 0:
        return np.eye(6)
    B = np.eye(6)  # from a step about the middle, rotation scaled, to a left step
    B[3:, 3:] /= found.extent
    B[:3, 3:] = skew(middle) / found.extent
    values, vectors = np.linalg.eigh(B.T @ found.H @ B / found.weight)
    loose = vectors[:, values < least_share]
    to_camera = np.eye(6)
    to_camera[:3, 3:] = -skew(T_target_source[:3, 3])
    directions = (to_camera @ B @ loose).T
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True)).reshape(-1, 6)
