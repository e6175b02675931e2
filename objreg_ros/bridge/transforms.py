# SPDX-License-Identifier: Apache-2.0
"""A node that hears /tf_static, where tf2_msgs is installed: it is no package of common_interfaces."""

from __future__ import annotations

from objreg_ros.bridge import qos
from objreg_ros.bridge.door import Door
from objreg_ros.bridge.static_frames import Mount, StaticFrames
from objreg_ros.data import Array

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

KEPT = 100  # messages of all that say how the parts of a robot sit on each other


def hear_static_frames(door: Door, wanted: bool = True) -> StaticFrames:
    """What /tf_static says, from now on; nothing ever where it is not ``wanted``, or of no type that is installed."""
    frames = StaticFrames()
    if wanted and TFMessage is not None:
        door.listen(TFMessage, "/tf_static", frames.hear, qos.latched(depth=KEPT))
    return frames


def hear_mount(door: Door, told: Array | None) -> Mount:
    """Where the camera sits on the body of the odometry: as ``told`` by a parameter, else as /tf_static says."""
    return Mount(told, hear_static_frames(door, told is None).between, door.get_logger().info)
