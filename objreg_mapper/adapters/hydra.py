# SPDX-License-Identifier: Apache-2.0
"""``objreg_to_hydra``: edges between two stamps on Hydra's topic ``external_loop_closures``.

Hydra looks up the nearest of its own agent nodes for each stamp, waits for it, and drops an edge where that is a
second away or more (``max_time_difference``).
"""

from __future__ import annotations

import sys

from objreg_mapper.adapters.adapter import Adapter, require
from objreg_mapper.adapters.body import Body
from objreg_mapper.adapters.params import BodyParams, ToHydraParams
from objreg_mapper.formats.pose_graph_tools import fill_edge
from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.spin import run
from objreg_ros.data.closures import LoopClosure

try:
    from pose_graph_tools_msgs.msg import PoseGraph, PoseGraphEdge
except ImportError:  # only who has Hydra has it
    PoseGraph = PoseGraphEdge = None

INSTALL = "build pose_graph_tools_msgs of github.com/MIT-SPARK/pose_graph_tools with colcon"


class ToHydra(Adapter):
    """Publishes one pose graph of one edge a constraint."""

    def __init__(self) -> None:
        require(PoseGraph, "pose_graph_tools_msgs", INSTALL)
        super().__init__("objreg_to_hydra", ToHydraParams, BodyParams)
        self._robot = self.settings.of(ToHydraParams).robot
        self._body = Body(self)
        self._graphs = self.create_publisher(PoseGraph, "external_loop_closures", qos.stage(depth=100))
        self.listen_for_closures()

    def hand_over(self, closure: LoopClosure) -> bool:
        """Publish it, if Hydra listens and the camera's place is known."""
        T_body_camera = self._body.of(closure)
        if T_body_camera is None or not self._graphs.get_subscription_count():
            return False
        header = to_msg.header(closure.to_ns, "")
        edge = fill_edge(PoseGraphEdge(header=header), closure, T_body_camera, self._robot)
        self._graphs.publish(PoseGraph(header=header, edges=[edge]))
        return True


def main() -> int:
    """The executable ``objreg_to_hydra``."""
    return run(ToHydra)


if __name__ == "__main__":
    sys.exit(main())
