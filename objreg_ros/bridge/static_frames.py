# SPDX-License-Identifier: Apache-2.0
"""Where the parts of a robot sit on each other, as /tf_static says: the little of tf2 that a mounted IMU needs.

Reads attributes only, so the messages of rclpy and of rosbags (tf2_msgs/TFMessage of ROS 1 and 2) both fit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.data import Array
from objreg_ros.geometry import inverse, pose, rotation_from_quaternion

MOST_FRAMES = 10_000  # what says more is no robot


class StaticFrames:
    """A forest of frames, each with its pose in its parent; the last word on a frame counts."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def hear(self, message: Any) -> None:
        """Take a TFMessage in. ValueError for a transform without a rotation, or beyond all measure."""
        for one in message.transforms:
            parent, child = one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")
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
