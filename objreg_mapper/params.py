# SPDX-License-Identifier: Apache-2.0
"""The parameters of the mapper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_mapper.optimisation.steady import Steady
from objreg_ros.params import MountedParams, Params, param, require_namespaces

GONE = dict.fromkeys(
    ("min_sigma_translation", "min_sigma_rotation"),
    "it is LEAST_SIGMAS in objreg_mapper/closure_constraint.py; what constraints share is picture_*_error",
)

# How our own tracking errs after one metre or one radian, one sigma, in m and degrees: over 1 to 20 frames by 0.033 to
# 0.044 m and 1.5 to 3.6 degrees on two recordings of a Kinect, slow and fast; 0.06 to 0.07 m and 1 to 1.3
# degrees with a simulated RealSense D435, and by less with other simulated sensors.
TRACKING_ERRORS = 0.07, 3.0
VAGUER = 10.0  # times the deviations of odometry, where closures are trusted


@dataclass(frozen=True)
class MapperParams(Params):
    """The parameters of the mapper."""

    DROPPED = GONE

    keyframe_translation: float = param(0.25, "motion after which odometry becomes a keyframe", "m", ge=0.01, live=True)
    keyframe_rotation: float = param(
        15.0, "rotation after which odometry becomes a keyframe", "deg", ge=0.1, le=180.0, live=True
    )

    # How odometry is believed: errors grow with the square root of the path, so a steady bias fits in over a long path.
    odometry_translation_error: float = param(
        0.02, "error of position after one metre or one radian, one sigma", "m", ge=1e-4
    )
    odometry_rotation_error: float = param(
        1.0, "error of rotation after one metre or one radian, one sigma", "deg", ge=1e-3
    )
    # And its steady error, which the closures reveal; 0 is never any.
    steady_heading: float = param(
        1.0, "error of heading that every metre adds alike, one sigma", "deg/m", ge=0.0, live=True
    )
    steady_distance: float = param(
        0.02, "error of position that every metre adds alike, one sigma", "m/m", ge=0.0, live=True
    )
    max_speed: float = param(5.0, "odometry that leaps faster than this has begun anew", "m/s", ge=0.1)
    # What a picture's depth, its lag behind colour and its shutter do to all constraints of it alike.
    picture_translation_error: float = param(
        0.01, "error of position that all constraints of a keyframe share, one sigma; 0 is none", "m", ge=0.0, live=True
    )
    picture_rotation_error: float = param(
        0.5,
        "error of rotation that all constraints of a keyframe share, one sigma; 0 is none",
        "deg",
        ge=0.0,
        live=True,
    )
    max_stretch: float = param(
        1.5,
        "a constraint over more than so many times the path of odometry, and a metre, is implausible",
        ge=1.0,
        live=True,
    )
    max_residual: float = param(
        3.5, "a constraint farther than this from all the others is pruned", "standard deviations", ge=1.0, live=True
    )
    trust: str = param(
        "weigh",
        "who decides where constraints that agree contradict odometry: weigh, both by their deviations; odometry, what "
        "it contradicts beyond both deviations is held back; closures, its deviations are taken for ten times as large",
        choices=("weigh", "odometry", "closures"),
    )
    pairwise_consistency: bool = param(
        False, "whether constraints come into the graph only where they agree with most others in pairs", live=True
    )

    @classmethod
    def of_tracking(cls) -> MapperParams:
        """Those with which our own tracking is corrected.

        It has no up, and what it gets wrong goes with what it sees, so nothing in it is steady.
        """
        metres, degrees = TRACKING_ERRORS
        return cls(
            odometry_translation_error=metres, odometry_rotation_error=degrees, steady_heading=0.0, steady_distance=0.0
        )

    @property
    def odometry_sigmas(self) -> tuple[float, float]:
        """How odometry wanders in m and rad, after one metre or one radian, as far as it is trusted."""
        vague = VAGUER if self.trust == "closures" else 1.0
        return vague * self.odometry_translation_error, vague * float(np.radians(self.odometry_rotation_error))

    @property
    def picture_sigmas(self) -> tuple[float, float]:
        """How far a picture is from its keyframe, m and rad."""
        return self.picture_translation_error, float(np.radians(self.picture_rotation_error))

    @property
    def steady(self) -> Steady:
        """The standard deviations of what is steadily wrong with odometry."""
        return Steady(float(np.radians(self.steady_heading)), self.steady_distance, self.steady_distance)


@dataclass(frozen=True)
class MapperNodeParams(MountedParams):
    """Frames and files of the mapper's node."""

    robots: tuple[str, ...] = param(
        (),
        "the namespaces of robots that drive at the same time, each with its own odom, path and correction there; "
        "empty: one robot, whose topics are the mapper's own",
    )
    map_frame: str = param("map", "the frame of the corrected map")
    input: str = param(
        "auto",
        "the topic of the constraints; auto: both, each constraint is taken once",
        choices=("auto", "loop_closures", "constraints"),
    )
    publish_tf: bool = param(True, "whether the correction is broadcast on /tf, where tf2_ros is installed", live=True)
    graph_path: str = param(
        "objreg_map.g2o", "where ~/save writes the pose graph; beside it, as .npz, what resume needs", at_start=True
    )
    resume: bool = param(False, "whether the map that was saved at graph_path is gone on with; it has to be there")

    def __post_init__(self) -> None:
        super().__post_init__()
        require_namespaces("robots", self.robots)
