# SPDX-License-Identifier: Apache-2.0
"""What gravity says of a pose that surfaces and grey have found.

Where depth errs systematically, two views of a floor tilt against each other, and a tilt of a degree is five
centimetres over three metres. Gravity as a whole session felt it knows better. Both are weighed by their covariances:
an update of Kalman, "A new approach to linear filtering and prediction problems", 1960.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, rotation_from_vector, skew
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.sensor import MANY_VIEWS_DEG

POSE_SIGMA_DEG = 0.4  # standard deviation of the tilt of a right pose before gravity corrects it
UPRIGHT = np.array([0.0, -1.0, 0.0])  # up in a camera of which nothing else is known: it is not carried upside down
UPRIGHT_SIGMA_DEG = 35.0  # standard deviation of that


class GravityError(NamedTuple):
    """The angle between the two gravities under a pose: in degrees, None where one is unknown, and in deviations."""

    degrees: float | None
    sigmas: float


def gravity_error(source: Prepared, target: Prepared, T_target_source: Array) -> GravityError:
    """How far a pose is from keeping gravity. A view whose gravity is unknown counts as held upright, more or less."""
    (up, sigma), (other, other_sigma) = (_upright(view) for view in (source, target))
    error = float(np.degrees(np.arccos(np.clip(T_target_source[:3, :3] @ up @ other, -1.0, 1.0))))
    deviation = float(np.sqrt(sigma**2 + other_sigma**2 + POSE_SIGMA_DEG**2))
    known = source.up is not None and target.up is not None
    return GravityError(error if known else None, error / deviation)


def _upright(view: Prepared) -> tuple[Array, float]:
    return (UPRIGHT, UPRIGHT_SIGMA_DEG) if view.up is None else (view.up, view.up_sigma_deg)


def gravity_update(source: Prepared, target: Prepared, T_target_source: Array, C: Array) -> tuple[Array, Array] | None:
    """The pose (4, 4) moved to where gravity is kept, and the information (6, 6) [t r] that gravity adds.

    It moves as far as its covariance ``C (6, 6)`` [t r] leaves that open.

    Gravity from a single view hardly counts here: its planes are those that hold the pose. None where one
    gravity is unknown.
    """
    if source.up is None or target.up is None or min(source.up_weight, target.up_weight) <= 0.0:
        return None
    carried = T_target_source[:3, :3] @ source.up
    turns = np.zeros((3, 6))
    turns[:, 3:] = -skew(carried)
    variance = np.radians(MANY_VIEWS_DEG) ** 2 * (1.0 / source.up_weight + 1.0 / target.up_weight)
    gain = C @ turns.T @ np.linalg.inv(turns @ C @ turns.T + variance * np.eye(3))
    step = gain @ (target.up - carried)
    moved = rotation_from_vector(step[3:]) @ T_target_source[:3, :3], T_target_source[:3, 3] + step[:3]
    return pose(*moved), turns.T @ turns / variance
