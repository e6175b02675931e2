# SPDX-License-Identifier: Apache-2.0
"""A node that receives /tf_static and /tf, where tf2_msgs is installed: it is no package of common_interfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.mount import Mount
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.data.checked import Array

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

KEPT = 100  # messages of all that say how the parts of a robot sit on each other
MOVING = 100  # messages of /tf: a second of a robot


def is_installed() -> bool:
    """Whether /tf can be received at all."""
    return TFMessage is not None


def receive_frames(
    node: NodeBase, wanted: bool = True, then: Callable[[Any], None] = lambda message: None
) -> FrameTree:
    """What /tf_static and /tf say, from now on; nothing ever where it is not ``wanted``, or of no installed type.

    ``then`` is given each message of /tf behind that.
    """
    tree = FrameTree()

    def receive_moving(message: Any) -> None:
        try:
            tree.receive_moving(message)
        finally:
            then(message)

    if wanted and TFMessage is not None:
        node.listen(TFMessage, "/tf_static", tree.add_transforms, qos.latched(depth=KEPT))
        node.listen(TFMessage, "/tf", receive_moving, qos.sensor(reliable=False, depth=MOVING))
    return tree


def receive_mount(node: NodeBase, given: Array | None) -> Mount:
    """The pose of the camera on the body of the odometry: ``given``, a parameter's value, else that of /tf."""
    return Mount(given, receive_frames(node, given is None), node.get_logger().info)
