# SPDX-License-Identifier: Apache-2.0
"""How wrong an accepted pose may be.

The inverse information of a registration is scaled, floored, and opened along directions that the data leave free, each
by a parameter. The lower the view score of a pose, and the larger its residuals are, the less they know of what is
wrong with it: so much larger is the scale. What no residual shows comes on top: a camera whose lens or depth is not
quite as its calibration says measures every motion wrong by a share of it. config/covariance.yaml says how the
parameters were calibrated.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Alignment
from objreg_ros.geometry import rotation_angle, skew
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.params import RegistrationParams

SCALE_GROWTH = 2.4  # of the logarithm of the scale for each 1 that V is lower
REFERENCE_RMSE_M = 0.0065  # of the residuals at which the scale holds; it grows in proportion
LEAST_SIGMA_M = 0.001  # of each axis
LEAST_SIGMA_DEG = 0.025  # of each axis
DEGENERATE_SIGMA_M = 0.5  # along a degenerate direction of translation
DEGENERATE_SIGMA_DEG = 60.0  # about a degenerate axis
NEAREST = 0.3  # m: nothing is seen nearer


def covariance_of(candidate: Candidate, params: RegistrationParams) -> Array:
    """(6, 6) float64 [tx ty tz rx ry rz] of ``T_target_source`` in the target frame, positive definite."""
    alignment, disliked = candidate.alignment, 1.0 - candidate.verification.score
    doubt = float(np.exp(SCALE_GROWTH * disliked)) * alignment.rmse / REFERENCE_RMSE_M
    C = spread_of(alignment, params.covariance_scale * doubt)
    return C + _miscalibrated(alignment, params.covariance_calibration)


def spread_of(alignment: Alignment, scale: float = 1.0) -> Array:
    """The same of a camera that is as its calibration says: how far the pose may lie from the best one.

    What is decided is decided by the registration as it is, of ``scale`` 1.
    """
    C = scale * _inverse(alignment.information) + _floor()
    for direction in alignment.degenerate:
        C = C + _opened(direction)
    C = C + alignment.regularised.T @ alignment.regularised
    return np.asarray((C + C.T) / 2.0)


def worst_translation(C: Array) -> float:
    """The standard deviation in m along the direction in which the position is known least."""
    return float(np.sqrt(np.linalg.eigvalsh(C[:3, :3])[-1]))


def _miscalibrated(alignment: Alignment, share: float) -> Array:
    """What a wrong calibration adds: what was seen is shifted and turned about its middle by a share of the motion.

    To a camera a shift looks like a turn, by as much as it is near to what it sees. Two views of a scene that is
    stretched by a share along the optical axis of each differ by a turn of that share times the sine of the angle
    between them: a quarter turn is the worst, and beyond it nothing is added.
    """
    R, t, middle = alignment.T_target_source[:3, :3], alignment.T_target_source[:3, 3], alignment.middle
    shift, range_m = float(np.linalg.norm(t)), max(float(np.linalg.norm(middle)), NEAREST)
    turn = float(np.sin(min(np.hypot(rotation_angle(R), shift / range_m), np.pi / 2)))
    camera_from_middle = np.eye(6)
    camera_from_middle[:3, 3:] = skew(middle - t)
    motion = share * np.array([shift] * 3 + [turn] * 3)
    return np.asarray(camera_from_middle @ np.diag(motion**2) @ camera_from_middle.T)


def _floor() -> Array:
    rotation = np.radians(LEAST_SIGMA_DEG)
    return np.diag(np.square([LEAST_SIGMA_M] * 3 + [rotation] * 3))


def _inverse(information: Array) -> Array:
    """The inverse, bounded: what the data say nothing of gets 1 m or 1 rad, not infinity."""
    values, vectors = np.linalg.eigh((information + information.T) / 2.0)
    return np.asarray((vectors / np.maximum(values, 1.0)) @ vectors.T)


def _opened(direction: Array) -> Array:
    """The variance along a free direction: as far as the free part of the motion may go."""
    turned = float(np.linalg.norm(direction[3:]))
    sigma = DEGENERATE_SIGMA_DEG * np.pi / 180.0 if turned > 0.5 else DEGENERATE_SIGMA_M
    return np.asarray(sigma**2 * np.outer(direction, direction))
