# SPDX-License-Identifier: Apache-2.0
"""From a closure to the constraint between two keyframes: what it says there, and how well it is known.

A closure that claims what cannot be is refused. A covariance is raised where it claims more than any closure knows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from objreg_mapper.constraint import Constraint, between_keyframes, floored
from objreg_mapper.optimisation.problem import End
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure

LEAST_SIGMAS = 1e-3, float(np.radians(0.025))  # m and rad: no constraint is believed to know better, whatever it claims
SLACK_M = 1.0  # that a closure may lead farther than any path: odometry at rest trembles, and is not the camera
VAGUEST = 1e12  # m^2 and rad^2: ROS says "unknown" by less; what is known no better adds nothing
Mounting = Callable[[str, str], Array | None]  # T_body_camera of a robot and a camera's frame; None: they are one


class ImplausibleError(ValueError):
    """A closure claims what cannot be: a path that no body took, or a pose of which nothing is known."""


def constraint_of(
    closure: LoopClosure,
    ends: tuple[End, End],
    sessions: Sequence[Session],
    mounting: Array | Mounting | None,
    params: MapperParams,
) -> Constraint:
    """What a closure says of the bodies at two keyframes; `mounting` is where the cameras are on these.

    `ImplausibleError` for one that leads farther than odometry went, or knows nothing. No constraint knows better than
    `LEAST_SIGMAS`.
    """
    one, other = (sessions[end.session] for end in ends)
    mounts = _mounted(mounting, one.robot, closure.from_frame_id), _mounted(mounting, other.robot, closure.to_frame_id)
    stamps_ns = one.keyframes.stamps_ns[ends[0].keyframe], other.keyframes.stamps_ns[ends[1].keyframe]
    odometry = one.odometry, other.odometry
    with np.errstate(over="ignore", invalid="ignore"):  # what is no number then is refused
        constraint = between_keyframes(closure, odometry, stamps_ns, mounts, params.odometry_sigmas)
    _refuse_vague(constraint)
    if ends[0].session == ends[1].session:
        _refuse_far(constraint, one, (ends[0].keyframe, ends[1].keyframe), params)
    return constraint._replace(covariance=floored(constraint.covariance, LEAST_SIGMAS))


def _mounted(mounting: Array | Mounting | None, robot: str, frame_id: str) -> Array:
    """``T_body_camera`` of a camera on a robot."""
    T = mounting(robot, frame_id) if callable(mounting) else mounting
    return np.eye(4) if T is None else T


def _refuse_vague(constraint: Constraint) -> None:
    known = np.abs(constraint.covariance).max()
    if not known <= VAGUEST:
        raise ImplausibleError(f"expected variances of at most {VAGUEST:g} m^2 and rad^2, got {known:g}")


def _refuse_far(constraint: Constraint, session: Session, keyframes: tuple[int, int], params: MapperParams) -> None:
    path, metres = session.path_m(*keyframes), np.linalg.norm(constraint.T_from_to[:3, 3])
    most = SLACK_M + params.max_stretch * path + params.max_speed * session.silent_s(*keyframes)
    if not metres <= most:
        raise ImplausibleError(
            f"expected a constraint over at most {most:.2f} m, as odometry went {path:.2f} m meanwhile, "
            f"got {metres:.4g} m"
        )
