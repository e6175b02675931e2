# SPDX-License-Identifier: Apache-2.0
"""The odometry of a consumer's body, held as the mapper holds it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nav_msgs.msg import Odometry as OdometryMsg

from objreg_mapper.params import MapperParams
from objreg_mapper.restart import Anew, Restart
from objreg_ros.bridge.messages import motion_from_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.data.frames import Odometry


class OdometryIn:
    """Receives ``odom``; ``follow`` is given every pose that goes on, ``anew`` why it began elsewhere, before that."""

    def __init__(self, node: NodeBase, follow: Callable[[Odometry], object], anew: Callable[[Anew], object]) -> None:
        self.newest: Odometry | None = None
        self.passed_over = 0
        self._node, self._follow, self._anew = node, follow, anew
        self._restart = Restart(MapperParams().max_speed, self._pass_over)
        node.listen(OdometryMsg, "odom", self._receive, node.sensor(qos.ODOMETRY), watched="odom")

    def _receive(self, message: Any) -> None:
        odometry = self._node.read_aside("odom", motion_from_msg.odometry, message)
        if odometry is None:
            return
        admission = self._restart.admit(odometry)
        if admission.anew is not None:
            self._node.throttled.warn("new_map", f"odometry began anew ({admission.anew.value})")
            self._anew(admission.anew)
        for admitted in admission.poses:
            self.newest = admitted
            self._follow(admitted)

    def _pass_over(self, _: Odometry) -> None:
        self.passed_over += 1
