# SPDX-License-Identifier: Apache-2.0
"""``objreg_to_rtabmap``: links between RTAB-Map's own nodes, by its service ``add_link``.

A constraint waits for RTAB-Map and for the nodes around its keyframes. One link is in flight at a time; one that is not
answered is asked again. RTAB-Map's answer is empty, so what it refuses itself is in its log.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from functools import partial
from typing import Any, NamedTuple

from rclpy.task import Future

from objreg_mapper.adapters.adapter import Adapter, require, seconds
from objreg_mapper.adapters.body import Body
from objreg_mapper.adapters.diagnostics import RtabmapDiagnostics
from objreg_mapper.adapters.odometry_in import OdometryIn
from objreg_mapper.adapters.params import BodyParams, ToRtabmapParams
from objreg_mapper.adapters.rtabmap_nodes import RtabmapNodes
from objreg_mapper.formats.rtabmap import fill_link
from objreg_mapper.restart import Anew
from objreg_mapper.sparse import SparseTrajectory
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.node_base import DroppedError
from objreg_ros.bridge.node.spin import run
from objreg_ros.data.closures import LoopClosure, Moments
from objreg_ros.data.frames import Odometry
from objreg_ros.diagnostics import Diagnostics

try:
    from rtabmap_msgs.msg import MapData
    from rtabmap_msgs.srv import AddLink, GetMap
except ImportError:  # only who has RTAB-Map has it
    MapData = AddLink = GetMap = None

INSTALL = "apt install ros-$ROS_DISTRO-rtabmap-msgs"


class _Asked(NamedTuple):
    """The link that is in flight."""

    key: Moments
    future: Future
    since: float


class ToRtabmap(Adapter):
    """Snaps constraints to nodes of RTAB-Map and links these."""

    def __init__(self) -> None:
        require(AddLink, "rtabmap_msgs", INSTALL)
        super().__init__("objreg_to_rtabmap", ToRtabmapParams, BodyParams)
        self._limits = self.settings.of(ToRtabmapParams)
        self._nodes, self._odometry = RtabmapNodes(), SparseTrajectory()
        self._asked: _Asked | None = None
        self._attempts: Counter[Moments] = Counter()
        self._since: dict[Moments, float] = {}  # when a constraint first found RTAB-Map without the nodes that it needs
        self._databases = 0
        self._body = Body(self)
        self._odom = OdometryIn(self, self._follow, self._begin_anew)
        self._add = self.create_client(AddLink, "rtabmap/add_link")
        self._get = self.create_client(GetMap, "rtabmap/get_map_data")
        self._wants_graph = True
        self._graph: Future | None = None
        self._graph_since = -math.inf  # when it was asked for
        self.listen(MapData, "mapData", self._on_map, qos.stage(depth=10))
        self.listen_for_closures()

    # What RTAB-Map and odometry send

    def _follow(self, odometry: Odometry) -> None:
        self._odometry.append(odometry.stamp_ns, odometry.T_odom_body)

    def _begin_anew(self, _: Anew) -> None:
        self._odometry = SparseTrajectory()

    def _on_map(self, message: Any) -> None:
        is_other = self.read_aside("mapData", self._nodes.add_map_data, message)
        if is_other:
            self._databases += 1
            self._want_graph()
            self._since.clear()
            self.get_logger().warning("RTAB-Map began another database: its former nodes are forgotten")

    def go_through(self) -> None:
        """As any adapter, while RTAB-Map is there; what is not answered is given up first."""
        if self._asked is not None and seconds() - self._asked.since > self._limits.answer_within:
            self._give_up(self._asked)
        if not self._add.service_is_ready():
            self._await_rtabmap()
            return
        is_due = seconds() - self._graph_since > self._limits.answer_within
        if self._wants_graph and is_due and self._get.service_is_ready():
            self._ask_for_graph()
        if self._asked is None:
            super().go_through()

    def _await_rtabmap(self) -> None:
        """It may come back with another database, so nothing that is known of its nodes holds."""
        self._nodes.clear()
        self._since.clear()
        self._want_graph()

    def _want_graph(self) -> None:
        self._wants_graph, self._graph_since = True, -math.inf

    def _ask_for_graph(self) -> None:
        """The nodes from before this node was there; ``mapData`` has the newest only. Again where no answer comes."""
        if self._graph is not None:
            self._get.remove_pending_request(self._graph)
        request = GetMap.Request(global_map=True, optimized=False, graph_only=True)
        self._graph, self._graph_since = self._get.call_async(request), seconds()
        self._graph.add_done_callback(self._on_graph)

    def _on_graph(self, future: Future) -> None:
        if future.exception() is None and future.result() is not None:
            self._wants_graph = False
            self._on_map(future.result().data)

    # What it receives

    def hand_over(self, closure: LoopClosure) -> bool:
        """Ask for the link, if no other is in flight and the nodes are known; it is settled by the answer."""
        if self._asked is not None or not len(self._nodes):
            return False
        T_base_camera = self._body.of(closure, self._odom.newest)
        if T_base_camera is None:
            return False
        tied = self._nodes.tied(closure, self._odometry, T_base_camera) if self._has_nodes(closure) else None
        if tied is None:
            self._be_patient(closure)
            return False
        from_id, to_id, constraint = tied
        if from_id == to_id:
            raise DroppedError("same_node", f"both keyframes are nearest to node {from_id} of RTAB-Map")
        request = AddLink.Request()
        fill_link(request.link, constraint, from_id, to_id)
        self._ask(closure.moments, request)
        return False

    def _offset_s(self, closure: LoopClosure) -> float:
        """How far the worse of the two keyframes is from its node."""
        stamps_ns = closure.from_ns, closure.to_ns
        return 1e-9 * max(abs(self._nodes.nearest(stamp_ns).stamp_ns - stamp_ns) for stamp_ns in stamps_ns)

    def _has_nodes(self, closure: LoopClosure) -> bool:
        return self._offset_s(closure) <= self._limits.max_offset

    def _be_patient(self, closure: LoopClosure) -> None:
        """`DroppedError` where a constraint has waited for its nodes for too long."""
        since = self._since.setdefault(closure.moments, seconds())
        if seconds() - since < self._limits.patience:
            return
        if self._has_nodes(closure):
            raise DroppedError("no_way", "neither odometry nor nodes of one map lead from its keyframes to their nodes")
        raise DroppedError(
            "no_node",
            f"expected nodes of RTAB-Map within {self._limits.max_offset:g} s of both keyframes, got one "
            f"{self._offset_s(closure):.3f} s away",
        )

    def _ask(self, key: Moments, request: Any) -> None:
        self._attempts[key] += 1
        future = self._add.call_async(request)
        self._asked = _Asked(key, future, seconds())
        future.add_done_callback(partial(self._on_answer, self._asked))

    def _on_answer(self, asked: _Asked, future: Future) -> None:
        if self._asked is None or self._asked.future is not future or future.cancelled():
            return
        self._asked = None
        if future.exception() is None:
            self.note_delivered(asked.key)
        else:
            self._end_hopeless(asked.key)

    def _give_up(self, asked: _Asked) -> None:
        """Ask again later: RTAB-Map is gone, or is busy with its map."""
        self._asked = None
        self._add.remove_pending_request(asked.future)
        asked.future.cancel()
        self._end_hopeless(asked.key)

    def _end_hopeless(self, key: Moments) -> None:
        """Never ask again what was asked too often."""
        if key in self.waiting and self._attempts[key] >= self._limits.most_attempts:
            self.drop_constraint(key, "unanswered", f"add_link was asked {self._attempts[key]} times")

    def is_in_flight(self, key: Moments) -> bool:
        """Whether RTAB-Map was asked and has not answered."""
        return self._asked is not None and self._asked.key == key

    def forget_constraint(self, key: Moments) -> None:
        """Its patience and its attempts are over."""
        self._since.pop(key, None)
        self._attempts.pop(key, None)

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """And what is known of RTAB-Map."""
        answers = self._add.service_is_ready()
        own = RtabmapDiagnostics(nodes=len(self._nodes), databases=self._databases, answers=answers)
        return (*super().own_diagnostics(), own)


def main() -> int:
    """The executable ``objreg_to_rtabmap``."""
    return run(ToRtabmap)


if __name__ == "__main__":
    sys.exit(main())
