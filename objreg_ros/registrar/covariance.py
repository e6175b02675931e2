# SPDX-License-Identifier: Apache-2.0
"""How wrong an accepted pose may be.

The inverse information of a registration is over-confident: its points are not independent and its correspondences are
not certain. So it is scaled, floored, and opened along directions that the data leave free, each by a parameter;
config/covariance.yaml says how they were calibrated.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Alignment, Array
from objreg_ros.registrar.params import RegistrarParams


def covariance_of(alignment: Alignment, params: RegistrarParams) -> Array:
    """(6, 6) float64 [tx ty tz rx ry rz] of ``T_target_source`` in the target frame, positive definite."""
    C = params.covariance_scale * _inverse(alignment.information) + _floor(params)
    for direction in alignment.slack:
        C = C + _opened(direction, params)
    C = C + alignment.held.T @ alignment.held
    return np.asarray((C + C.T) / 2.0)


def worst_translation(C: Array) -> float:
    """The standard deviation in m along the direction in which the position is known least."""
    return float(np.sqrt(np.linalg.eigvalsh(C[:3, :3])[-1]))


def _floor(params: RegistrarParams) -> Array:
    rotation = np.radians(params.covariance_floor_rotation)
    return np.diag(np.square([params.covariance_floor_translation] * 3 + [rotation] * 3))


def _inverse(information: Array) -> Array:
    """The inverse, bounded: what the data say nothing of gets 1 m or 1 rad, not infinity."""
    values, vectors = np.linalg.eigh((information + information.T) / 2.0)
    return np.asarray((vectors / np.maximum(values, 1.0)) @ vectors.T)


def _opened(direction: Array, params: RegistrarParams) -> Array:
    """The variance along a free direction: as far as the free part of the motion may go."""
    turned = float(np.linalg.norm(direction[3:]))
    sigma = params.slack_rotation * np.pi / 180.0 if turned > 0.5 else params.slack_translation
    return np.asarray(sigma**2 * np.outer(direction, direction))
