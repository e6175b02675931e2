# SPDX-License-Identifier: Apache-2.0
"""Two keyframes of one place: the pose between them with its evidence, or the reason for none."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import field, fields
from enum import Enum

import numpy as np

from objreg_ros.data.checked import (
    Array,
    data_type,
    hold_array,
    hold_pose,
    require,
)

LEAST_VARIANCE = 1e-30  # m^2, rad^2: the information of less is no number that can be reckoned with
MOVED = re.compile(r"moved (?P<label>.+) \[m\]")  # evidence: how far an object of the label went
Moments = tuple[str, int, str, int]  # of a closure: camera and stamp in ns of *from*, and of *to*
Robots = tuple[str, str]  # of a closure: that of *from* and that of *to*, empty where it is not known


@data_type
class Alignment:
    """A registration and its evidence.

    ``information (6, 6) float64`` of the error ``[tx ty tz rx ry rz]`` in the target frame; ``inliers`` how many source
    points found a partner; ``overlap`` their share 0..1; ``rmse`` m of the inliers; ``degenerate (K, 6) float64`` unit
    directions of the same tangent space that the data leave open, K may be 0; ``regularised (L, 6) float64`` motions of
    one sigma along directions that only the look of the whole holds; ``middle (3,) float64`` m is that of what was
    aligned, in the target frame.
    """

    T_target_source: Array
    information: Array
    inliers: int
    overlap: float
    rmse: float
    converged: bool
    degenerate: Array = field(default_factory=lambda: np.zeros((0, 6)))
    regularised: Array = field(default_factory=lambda: np.zeros((0, 6)))
    middle: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        hold_pose(self, "T_target_source")
        for name, shape in (
            ("middle", (3,)),
            ("information", (6, 6)),
            ("degenerate", (None, 6)),
            ("regularised", (None, 6)),
        ):
            hold_array(self, name, np.float64, shape, {})


@data_type
class ObjectMatch:
    """An object that lies upon itself under a closure: its label and the id of its landmark."""

    label: str
    object_id: int


@data_type
class Observation:
    """An object as a keyframe saw it: its label, the id of its landmark, and its middle ``xyz (3,)`` m in the camera.

    The id stays the same over keyframes and sessions, until two landmarks turn out to be one: then the older one's
    stays.
    """

    label: str
    object_id: int
    xyz: Array

    def __post_init__(self) -> None:
        hold_array(self, "xyz", np.float64, (3,), {})


def may_be_same(robots: Robots, others: Robots) -> bool:
    """Whether the robots of two closures are the same, as far as both are known."""
    return all(a == b or not a or not b for a, b in zip(robots, others, strict=True))


def framed(robot: str, frame_id: str) -> str:
    """A frame under the prefix of its robot, which it may have already."""
    return frame_id if not robot or frame_id.startswith(f"{robot}/") else f"{robot}/{frame_id}"


def robot_of(frame_id: str, robots: Sequence[str]) -> str:
    """The robot whose prefix a frame has, the longest name first; empty for none."""
    return next((robot for robot in sorted(robots, key=len, reverse=True) if frame_id.startswith(f"{robot}/")), "")


@data_type
class LoopClosure:
    """Two keyframes that saw the same place: ``T_from_to`` maps points of the camera at *to* into the camera at *from*.

    ``covariance (6, 6) float64`` in ROS order [tx ty tz rx ry rz], of the pose in the *from* frame; ``labels`` of the
    objects that closed it; ``objects`` those with their landmarks; ``evidence`` named numbers of the verification;
    ``from_frame_id`` and ``to_frame_id`` the names of the two cameras, which may be two of one robot; ``from_session``
    and ``to_session`` the runs of odometry that the keyframes belong to, None where it is not known; ``from_robot`` and
    ``to_robot`` the names of the robots whose runs these are, empty where they are not known.
    """

    from_ns: int
    to_ns: int
    T_from_to: Array
    covariance: Array
    labels: tuple[str, ...]
    objects: tuple[ObjectMatch, ...] = ()
    evidence: dict[str, float] = field(default_factory=dict)
    from_frame_id: str = "camera"
    to_frame_id: str = "camera"
    from_session: int | None = None
    to_session: int | None = None
    from_robot: str = ""
    to_robot: str = ""

    def __post_init__(self) -> None:
        hold_pose(self, "T_from_to")
        hold_array(self, "covariance", np.float64, (6, 6), {})
        C = self.covariance
        symmetric = bool(np.isfinite(C).all()) and bool(np.abs(C - C.T).max() <= 1e-6 * max(1e-12, np.abs(C).max()))
        require(self, symmetric, "a finite, symmetric covariance", C.tolist())
        least = np.linalg.eigvalsh((C + C.T) / 2).min()
        require(self, bool(least > LEAST_VARIANCE), "a positive definite covariance", C.tolist())

    @property
    def moments(self) -> Moments:
        """The identity of a closure: the same on every topic and at every publication."""
        return self.from_frame_id, self.from_ns, self.to_frame_id, self.to_ns

    @property
    def robots(self) -> Robots:
        """The robots of the two keyframes; the topic `constraints` does not carry them, objreg_msgs does."""
        return self.from_robot, self.to_robot

    @property
    def moved(self) -> dict[str, float]:
        """How far objects went that stood elsewhere before, m by label, from the evidence (see `MOVED`)."""
        found = ((MOVED.fullmatch(name), metres) for name, metres in self.evidence.items())
        return {name["label"]: metres for name, metres in found if name}


def refused(closure: LoopClosure, reason: Reason, detail: str) -> Rejected:
    """The refusal of what would have been this closure, with every field that the two have in common."""
    shared = {field.name: getattr(closure, field.name) for field in fields(Rejected) if hasattr(closure, field.name)}
    return Rejected(reason=reason, detail=detail, **shared)


@data_type
class Relocalised:
    """Where the camera is in the map of an earlier ``session``: the frame that the poses of its keyframes are in.

    ``T_map_odom`` maps the odometry of now into it, ``T_map_camera`` is the camera of the frame at ``stamp_ns``;
    ``covariance (6, 6) float64`` of that in ROS order, along the map's axes; ``closures`` is how many agree on it, the
    newest to the keyframe of ``target_ns``: where that session's odometry has drifted, its map holds around there.
    ``by_odometry`` says that odometry gave both sessions' poses: the map is level then, else it is a camera's frame.
    """

    stamp_ns: int
    session: int
    target_ns: int
    T_map_odom: Array
    T_map_camera: Array
    covariance: Array
    closures: int
    by_odometry: bool = True

    def __post_init__(self) -> None:
        hold_pose(self, "T_map_odom")
        hold_pose(self, "T_map_camera")
        hold_array(self, "covariance", np.float64, (6, 6), {})
        require(self, bool(np.isfinite(self.covariance).all()), "a finite covariance", self.covariance.tolist())


class Reason(Enum):
    """Why something was refused. The value is what diagnostics and JSON show."""

    NO_CANDIDATE = "no_candidate"
    NO_HYPOTHESIS = "no_hypothesis"
    NOT_CONVERGED = "not_converged"
    LOW_OVERLAP = "low_overlap"
    FREE_SPACE = "free_space_violated"
    TEXTURE = "texture_disagrees"
    FEW_OBJECTS = "few_objects_matched"
    PROPOSERS_DISAGREE = "proposers_disagree"
    GRAVITY = "gravity_not_kept"
    IMPLAUSIBLE_MOTION = "implausible_motion"
    ODOMETRY = "odometry_disagrees"
    SLACK = "slides_along_a_plane"
    MOVED = "objects_moved"
    REDUNDANT = "redundant"
    OVER_BUDGET = "over_budget"
    UNREADABLE = "unreadable"
    CLOCK = "clock_began_anew"
    NEIGHBOURS = "neighbours_disagree"
    CAMERA = "camera_implausible"
    VETOED = "vetoed"
    ALIKE = "places_alike"


UNTRIED = frozenset(
    {Reason.NO_CANDIDATE, Reason.REDUNDANT, Reason.OVER_BUDGET, Reason.UNREADABLE, Reason.CLOCK, Reason.CAMERA}
)


@data_type
class Rejected:
    """A refused closure: the reason, and the numbers behind it in ``detail``.

    ``T_from_to (4, 4)`` is the pose that was turned down, unchecked, for a look at it and nothing else; None where none
    was found. ``evidence`` are named numbers of it. The frames, sessions and robots are as in `LoopClosure`, empty and
    None where they are not known.
    """

    reason: Reason
    from_ns: int
    to_ns: int
    detail: str
    T_from_to: Array | None = None
    evidence: dict[str, float] = field(default_factory=dict)
    from_frame_id: str = ""
    to_frame_id: str = ""
    from_session: int | None = None
    to_session: int | None = None
    from_robot: str = ""
    to_robot: str = ""
