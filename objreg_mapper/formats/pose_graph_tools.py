# SPDX-License-Identifier: Apache-2.0
"""Hydra: the topic ``external_loop_closures``, pose_graph_tools_msgs/PoseGraph.

Append the edges to ``PoseGraph().edges``. Keys are times in nanoseconds: Hydra looks up the nearest of its own agent
nodes for them, which are poses of the body, and takes an edge's pose as it is for what lies between them.
"""

from __future__ import annotations

from typing import Any

from objreg_mapper.constraint import Constraint, compensated, inverted
from objreg_mapper.formats.pose import fill_pose
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse

LOOPCLOSE = 1


def fill_edge(edge: Any, closure: LoopClosure, T_body_camera: Array, robot: int = 0) -> Any:
    """The PoseGraphEdge of a closure, between the bodies at its two stamps.

    ``T_body_camera (4, 4)`` is the camera's optical frame on the body of Hydra's odometry, the identity
    where that is the camera. Hydra reads the pose as ``T_to_from``, so the closure goes in inverted.
    """
    measured = Constraint(closure.T_from_to, closure.covariance)
    constraint = inverted(compensated(measured, T_body_camera, inverse(T_body_camera)))
    edge.key_from, edge.key_to = closure.from_ns, closure.to_ns
    edge.robot_from = edge.robot_to = robot
    edge.type = LOOPCLOSE
    fill_pose(edge.pose.position, edge.pose.orientation, constraint.T_from_to)
    edge.covariance = constraint.covariance.ravel().tolist()
    return edge
