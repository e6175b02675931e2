# SPDX-License-Identifier: Apache-2.0
"""What a mapper does with a message of the topic `constraints`: decode it, and write an edge of its pose graph.

In a node `edge` is the callback of a subscription to `nav_msgs/Odometry`, reliable and transient local.
"""

import numpy as np
from nav_msgs.msg import Odometry

from objreg_mapper.constraint import Constraint
from objreg_mapper.formats.g2o import edge_text
from objreg_ros.bridge.messages import from_msg, to_msg
from objreg_ros.data.closures import LoopClosure


def edge(message: Odometry) -> str:
    """The constraint as a line of a g2o file; ValueError for a message that is no constraint."""
    closure = from_msg.loop_closure(message)
    print(f"{closure.from_frame_id} at {closure.from_ns} ns saw what {closure.to_frame_id} saw at {closure.to_ns} ns")
    print(f"T_from_to\n{closure.T_from_to.round(3)}")
    print(f"standard deviations {np.sqrt(np.diag(closure.covariance)).round(3)} m and rad")
    return edge_text(0, 1, Constraint(closure.T_from_to, closure.covariance))


def sent() -> Odometry:
    """A constraint as the registrar publishes it."""
    T, C = np.eye(4), 1e-4 * np.eye(6)
    T[:3, 3] = 0.1, 0.0, 0.02
    return to_msg.constraint(LoopClosure(from_ns=10**9, to_ns=95 * 10**8, T_from_to=T, covariance=C, labels=()))


if __name__ == "__main__":
    print(edge(sent()))
