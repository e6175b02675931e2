# SPDX-License-Identifier: Apache-2.0
"""Where the camera of a constraint sits on the body that a consumer ties."""

from __future__ import annotations

import numpy as np

from objreg_mapper.adapters.params import BodyParams
from objreg_ros.bridge.camera import transforms
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry


class Body:
    """Asks the parameter, then /tf_static for the frame of odometry, or ``base_frame`` where there is none.

    Nothing is assumed of frames that nobody ties: a camera's axes are not a body's, and a mapper forgets no edge.
    """

    def __init__(self, node: NodeBase) -> None:
        params = node.settings.of(BodyParams)
        self._mounting = params.mounting
        self._frame = params.base_frame
        self._frames = transforms.receive_frames(node, self._mounting is None)
        self._mount = transforms.Mount(self._mounting, self._frames, node.get_logger().info)
        self._remind = node.throttled.remind

    def T_body_camera(self, from_or_to: str, newest: Odometry | None = None) -> Array | None:
        """The pose (4, 4) of a camera's frame on the body; None while it is unknown.

        ``newest`` is a message of odometry, whose body counts more than the parameter.
        """
        body = newest.child_frame_id if newest is not None and newest.child_frame_id else self._frame
        named = self._mounting is not None or from_or_to.lstrip("/") == body.lstrip("/")
        if not named and self._frames.between(body.lstrip("/"), from_or_to.lstrip("/")) is None:
            self._remind(
                "body", f"expected to know where {from_or_to!r} sits on {body!r}, got no transform: constraints wait; "
                "publish it on /tf_static with tf2_msgs installed, or set T_base_camera (0 0 0 0 0 0 1 if they are one)"
            )  # fmt: skip
            return None
        odometry = [Odometry(T_odom_body=np.eye(4), stamp_ns=0, child_frame_id=body)]
        T = self._mount.T_body_camera(odometry, from_or_to)
        return np.eye(4) if T is None else T

    def of(self, closure: LoopClosure, newest: Odometry | None = None) -> Array | None:
        """That of the camera which saw the place again; None while it is unknown."""
        return self.T_body_camera(closure.to_frame_id, newest)
