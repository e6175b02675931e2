# SPDX-License-Identifier: Apache-2.0
"""Where known objects should be in the camera of a keyframe: those of its session, and of the map that is tied."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from objreg_ros.data.closures import Relocalised
from objreg_ros.data.frames import UNNAMED
from objreg_ros.geometry import inverse, transform
from objreg_ros.memory.known import Last
from objreg_ros.registrar.localisation.expectation import RANGE_M, Place, Shown
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.labels import LabelGroups

LEAST_VIEWS = 2  # keyframes that show an object: what one alone shows may be noise


def sigma_of(tied: Relocalised) -> float:
    """The standard deviation of each axis of the position in the map, m."""
    return math.sqrt(float(np.trace(tied.covariance[:3, :3])) / 3.0)


def shown_by(keyframe: Keyframe, groups: LabelGroups) -> list[Shown]:
    """The objects of a keyframe that have names."""
    return [Shown(groups.of(one.label), one.centroid) for one in keyframe.objects if one.label != UNNAMED]


def places_of(
    known: Iterable[tuple[int, Last, int]],
    keyframe: Keyframe,
    tied: Relocalised | None,
    since_ns: int,
    params: RegistrarParams,
) -> list[Place]:
    """The places of known objects that the keyframe's camera may see, with names and `LEAST_VIEWS` or more.

    Those of its session as odometry has them, if they were seen since ``since_ns``, and those of the ``tied`` map.
    """
    assert keyframe.T_odom_camera is not None
    groups, T_camera_odom = LabelGroups(params.label_groups), inverse(keyframe.T_odom_camera)
    T_camera_map = None if tied is None else T_camera_odom @ inverse(tied.T_map_odom)
    found = []
    for landmark, last, views in known:
        if views < LEAST_VIEWS or last.label == UNNAMED:
            continue
        if last.session == keyframe.session:
            if last.stamp_ns < since_ns:
                continue
            path = abs(keyframe.travelled - last.travelled)
            xyz = transform(T_camera_odom, last.position)
            sigma_m = params.odometry_translation_noise + params.odometry_drift * path
        elif tied is not None and T_camera_map is not None and last.session == tied.session:
            xyz, sigma_m = transform(T_camera_map, last.position), sigma_of(tied)
        else:
            continue
        if RANGE_M[0] < xyz[2] < RANGE_M[1]:
            found.append(Place(landmark, groups.of(last.label), xyz, last.extent, sigma_m))
    return found
