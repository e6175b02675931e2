# SPDX-License-Identifier: Apache-2.0
"""The parameters that decide a pair of keyframes."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import Params, param


@dataclass(frozen=True)
class ContextParams(Params):
    """What of a keyframe is compared."""

    context_range: float = param(4.0, "context farther from the camera is left out", "m", ge=0.5)
    label_groups: tuple[str, ...] = param(
        ("cup mouse bottle", "book remote cell_phone", "tv laptop"),
        "labels that detectors confuse: one group an item, spaces between (an underscore for a space in a name)",
    )


@dataclass(frozen=True)
class RegistrationParams(ContextParams):
    """How a pair of keyframes is registered, and what decides it."""

    method: str = param(
        "objreg", "how keyframes are registered; paper is the founding point-to-point ICP", choices=("objreg", "paper")
    )
    seed: int = param(0, "seed of what a registration draws at random", ge=0)

    # What odometry expects between two keyframes, and how surely.
    odometry_translation_noise: float = param(
        0.03, "standard deviation of odometry's position over no distance", "m", ge=0.0
    )
    odometry_rotation_noise: float = param(
        1.0, "standard deviation of odometry's rotation over no distance", "deg", ge=0.0
    )
    odometry_drift: float = param(
        0.1, "growth of the deviation of odometry's position with each metre of path", "m/m", ge=0.0
    )
    odometry_rotation_drift: float = param(
        0.05, "growth of the deviation of odometry's rotation with each degree turned", "deg/deg", ge=0.0
    )

    # What decides a closure.
    least_odds: float = param(
        75.0,
        "right poses for each false one, among poses as sure as the least sure that is accepted",
        ge=1.0,
        le=1e6,
        live=True,
    )
    max_translation: float = param(5.0, "largest distance between the two cameras", "m", ge=0.0)

    # How wrong an accepted pose may be; config/covariance.yaml says how these were calibrated.
    covariance_scale: float = param(
        0.45, "factor of the covariance, of a registration with a view score of 1 and an rmse of 6.5 mm", ge=0.0
    )
    covariance_calibration: float = param(
        0.035, "error of a motion, as a share of it, by a camera that is not quite as its calibration says", ge=0.0
    )
