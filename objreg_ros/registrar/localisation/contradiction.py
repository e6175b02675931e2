# SPDX-License-Identifier: Apache-2.0
"""Whether a closure says that the camera is where odometry says, and which closures agree on another place."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose_error
from objreg_ros.registrar.consistency import Statement, agree, path_m

ELSEWHERE_M, ELSEWHERE_DEG = 0.5, 30.0  # another place is at least so far away, or another way to face
DEVIATIONS = 3.0  # by which odometry has drifted at most


class Says(Enum):
    """What a closure says of where odometry has the camera."""

    HERE = "here"
    BESIDE = "beside"  # neither: odometry has drifted more than is expected, or so much is, that it would be elsewhere
    ELSEWHERE = "elsewhere"


class Tied(NamedTuple):
    """What is believed of the camera in a session: ``T_session_odom (4, 4)``, and how surely at this keyframe."""

    T_session_odom: Array
    sigma_m: float
    sigma_deg: float


class Difference(NamedTuple):
    """How far a closure puts the camera from where it is believed."""

    degrees: float
    metres: float


def tie_of(one: Statement) -> Array:
    """``T_session_odom (4, 4)`` as a closure has it: from the odometry of its source to its target's session."""
    return one.target.T_session_camera @ one.T_target_source @ inverse(one.source.T_session_camera)


def difference(one: Statement, tied: Tied) -> Difference:
    """Between the camera by the closure and by what is believed."""
    here = one.source.T_session_camera
    degrees, centimetres = pose_error(tie_of(one) @ here, tied.T_session_odom @ here)
    return Difference(degrees, 0.01 * centimetres)


def says(apart: Difference, tied: Tied) -> Says:
    """What a closure that is so far off says."""
    far_m, far_deg = DEVIATIONS * tied.sigma_m, DEVIATIONS * tied.sigma_deg
    if apart.metres <= min(far_m, ELSEWHERE_M) and apart.degrees <= min(far_deg, ELSEWHERE_DEG):
        return Says.HERE
    elsewhere = apart.metres > max(far_m, ELSEWHERE_M) or apart.degrees > max(far_deg, ELSEWHERE_DEG)
    return Says.ELSEWHERE if elsewhere else Says.BESIDE


def in_agreement(rivals: Sequence[Statement]) -> list[Statement]:
    """Those of ``rivals`` that agree with the newest by way of odometry, and it; empty where none does.

    Each is of two keyframes of its own.
    """
    *others, newest = rivals
    same = [one for one in others if _distinct(one, newest)]
    if not same:
        return []
    metres = np.array([path_m(one, newest) for one in same])
    found = [one for one, yes in zip(same, agree(same, newest, metres), strict=True) if yes]
    return [*found, newest] if found else []


def _distinct(one: Statement, other: Statement) -> bool:
    same_sessions = (one.source.session, one.target.session) == (other.source.session, other.target.session)
    return same_sessions and one.source.stamp_ns != other.source.stamp_ns
