# SPDX-License-Identifier: Apache-2.0
"""Where the parts of a robot sit on each other, as /tf_static says: the little of tf2 that a camera and an IMU need.

Reads attributes only, so the messages of rclpy and of rosbags (tf2_msgs/TFMessage of ROS 1 and 2) both fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.bridge import from_msg
from objreg_ros.data import Array, Odometry
from objreg_ros.geometry import inverse, pose, rotation_from_quaternion

MOST_FRAMES = 10_000  # what says more is no robot


FindPose = Callable[[str, str], Array | None]  # (a, b) -> T_a_b, None where unknown


class StaticFrames:
    """A forest of frames, each with its pose in its parent; the last word on a frame counts."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def hear(self, message: Any) -> None:
        """Take a TFMessage in. ValueError for a transform without a rotation, or beyond all measure."""
        for one in message.transforms:
            names = one.header.frame_id, one.child_frame_id
            parent, child = (from_msg.bounded(name, "tf_static").lstrip("/") for name in names)
            where, turn = one.transform.translation, one.transform.rotation
            t = np.array([where.x, where.y, where.z], float)
            if not np.abs(t).max() <= limits.MOST_DISTANCE:
                raise ValueError(f"tf_static: expected {child} within {limits.MOST_DISTANCE:g} m, got {t.tolist()}")
            if child not in self._parents and len(self._parents) >= MOST_FRAMES:
                raise ValueError(f"tf_static: expected at most {MOST_FRAMES} frames, got another one, {child}")
            R = rotation_from_quaternion(np.array([turn.x, turn.y, turn.z, turn.w], float))
            self._parents[child] = parent, pose(R, t)

    def between(self, a: str, b: str) -> Array | None:
        """``T_a_b (4, 4)``; None where nothing ties the two frames together."""
        of_a, of_b = self._ancestors(a), self._ancestors(b)
        shared = next((name for name in of_b if name in of_a), None)
        return None if shared is None else inverse(of_a[shared]) @ of_b[shared]

    def _ancestors(self, name: str) -> dict[str, Array]:
        """Ancestor → its ``T_ancestor_name``, the frame itself first; a ring of frames is gone round once."""
        found, T = {name: np.eye(4)}, np.eye(4)
        while name in self._parents:
            name, T_parent_child = self._parents[name]
            if name in found:
                break
            T = T_parent_child @ T
            found[name] = T
        return found


class Mount:
    """Where the camera sits on the body that odometry speaks of.

    ``told`` is what a parameter says, which wins; ``find`` is asked without one. What that does not know either is
    taken to be one place, as for odometry of the camera itself. ``say`` hears what is assumed, and hears it again only
    where that changes.
    """

    def __init__(self, told: Array | None, find: FindPose, say: Callable[[str], None] = lambda text: None) -> None:
        self._told, self._find, self._say = told, find, say
        self._said: dict[tuple[str, str], str] = {}

    def T_body_camera(self, words: Sequence[Odometry] | None, camera_frame: str) -> Array | None:
        """The pose (4, 4) of the camera on the body of these words of odometry; None where the two are one."""
        if self._told is not None or not words:
            return self._told
        body, camera = words[0].child_frame_id.lstrip("/"), camera_frame.lstrip("/")
        if body == camera:
            return None
        T = self._find(body, camera) if body and camera else None
        self._tell(body, camera, T)
        return T

    def _tell(self, body: str, camera: str, T: Array | None) -> None:
        if T is None:
            what = f"nothing on /tf_static ties the odometry's {body!r} to the camera's {camera!r}"
            text = f"{what}: taken to be one place; set T_base_camera where they are not"
        else:
            where = " ".join(f"{metres:.3f}" for metres in T[:3, 3])
            text = f"/tf_static has the camera's {camera!r} on the odometry's {body!r} at {where} m"
        if text != self._said.get((body, camera)):
            if len(self._said) >= MOST_FRAMES:
                self._said.clear()
            self._said[body, camera] = text
            self._say(text)
