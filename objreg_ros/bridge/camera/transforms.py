# SPDX-License-Identifier: Apache-2.0
"""A node that hears /tf_static and /tf, where tf2_msgs is installed: it is no package of common_interfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.mount import Mount
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.door import Door
from objreg_ros.data import Array

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

KEPT = 100  # messages of all that say how the parts of a robot sit on each other
MOVING = 100  # messages of /tf: a second of a robot


def is_installed() -> bool:
    """Whether /tf can be heard at all."""
    return TFMessage is not None


def hear_frames(door: Door, wanted: bool = True, then: Callable[[Any], None] = lambda message: None) -> FrameTree:
    """What /tf_static and /tf say, from now on; nothing ever where it is not ``wanted``, or of no installed type.

    ``then`` is given each message of /tf behind that.
    """
    tree = FrameTree()

    def hear_moving(message: Any) -> None:
        try:
            tree.hear_moving(message)
        finally:
            then(message)

    if wanted and TFMessage is not None:
        door.listen(TFMessage, "/tf_static", tree.hear, qos.latched(depth=KEPT))
        door.listen(TFMessage, "/tf", hear_moving, qos.sensor(reliable=False, depth=MOVING))
    return tree


def hear_mount(door: Door, told: Array | None) -> Mount:
    """Where the camera sits on the body of the odometry: as ``told`` by a parameter, else as /tf says."""
    return Mount(told, hear_frames(door, told is None), door.get_logger().info)
