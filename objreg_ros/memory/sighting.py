# SPDX-License-Identifier: Apache-2.0
"""One object of one keyframe, without its points: what retrieval, landmarks and thinning need to know of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_ros.memory.descriptor import describe
from objreg_ros.registration.keyframe import Keyframe


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sighting:
    """Object ``instance`` of a keyframe, in the frame of its session.

    ``extent`` m of the object, ``position (3,)`` of its middle and ``camera (3,)`` of the camera, m; ``travelled`` m
    of the camera's path in the session until then; ``by_odometry`` whether odometry gave the pose, or our own tracking,
    which may have slipped unnoticed; ``robot`` whose session it is; ``landmark`` the id that the object has wherever it
    is seen, 0 before it has one; ``R_landmark_session (3, 3)`` turns this session's axes into those of the session that
    saw the landmark first.
    """

    keyframe_id: int
    session: int
    stamp_ns: int
    instance: int
    label: str
    score: float
    extent: float
    descriptor: Array
    position: Array
    camera: Array
    travelled: float = 0.0
    by_odometry: bool = False
    robot: str = ""
    landmark: int = 0
    R_landmark_session: Array = field(default_factory=lambda: np.eye(3))

    @property
    def viewpoint(self) -> Array:
        """(3,) from the object to the camera in the landmark's axes: two alike are the same view."""
        return np.asarray(self.R_landmark_session @ (self.camera - self.position))

    def of_landmark(self, landmark: int, R_landmark_session: Array) -> Sighting:
        """The same sighting as one of this landmark."""
        return replace(self, landmark=landmark, R_landmark_session=R_landmark_session)


def sightings_of(keyframe: Keyframe) -> tuple[Sighting, ...]:
    """A sighting for each object, in their order, without landmarks yet."""
    T_session_camera = np.eye(4) if keyframe.T_odom_camera is None else keyframe.T_odom_camera
    return tuple(
        Sighting(
            keyframe_id=keyframe.keyframe_id,
            session=keyframe.session,
            stamp_ns=keyframe.stamp_ns,
            instance=item.cloud.instance,
            label=item.label,
            score=item.cloud.score,
            extent=item.extent,
            descriptor=describe(item.cloud),
            position=transform(T_session_camera, item.centroid),
            camera=np.array(T_session_camera[:3, 3]),
            travelled=keyframe.travelled,
            by_odometry=keyframe.by_odometry,
            robot=keyframe.robot,
        )
        for item in keyframe.objects
    )
