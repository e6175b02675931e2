# SPDX-License-Identifier: Apache-2.0
"""Hydra: the topic ``external_loop_closures``, pose_graph_tools_msgs/PoseGraph.

Append the edges to ``PoseGraph().edges``. Keys are times in nanoseconds: Hydra looks up its own keyframes for them.
"""

from __future__ import annotations

from typing import Any

from objreg_ros.data import LoopClosure
from objreg_ros.mapper.adapters.pose import fill_pose
from objreg_ros.mapper.constraint import Constraint, inverted

LOOPCLOSE = 1


def fill_edge(edge: Any, closure: LoopClosure, robot: int = 0) -> Any:
    """The PoseGraphEdge of a closure. Hydra reads the pose as ``T_to_from``, so the closure goes in inverted."""
    constraint = inverted(Constraint(closure.T_from_to, closure.covariance))
    edge.key_from, edge.key_to = closure.from_ns, closure.to_ns
    edge.robot_from = edge.robot_to = robot
    edge.type = LOOPCLOSE
    fill_pose(edge.pose.position, edge.pose.orientation, constraint.T_from_to)
    edge.covariance = constraint.covariance.ravel().tolist()
    return edge
