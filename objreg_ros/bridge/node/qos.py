# SPDX-License-Identifier: Apache-2.0
"""How messages are delivered, by what they are."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

ODOMETRY = 1000  # odometry messages, some seconds of the fastest
KEPT_CONSTRAINTS = 1000  # of the latched constraints: what a mapper that comes late still gets
KEPT_KEYFRAMES = 128  # packed ones of a camera: a minute of a link that is away, at two a second
KEPT_SUMMARIES = 2000  # half a kilobyte each: what a robot that comes late receives the others
REFUSALS = 100  # messages, one a searched keyframe
SINGLE_REFUSALS = 1000  # messages, one a refusal


def sensor(reliable: bool, depth: int = 10) -> QoSProfile:
    """The QoS of a camera's data. Best effort matches every publisher; reliable only reliable ones, and loses nothing.

    Ten messages deep: the newest wins in our own queue, where what it replaces is counted, and not inside DDS. Odometry
    is small and every message counts: `ODOMETRY` deep, so that a pause of Python of some seconds loses none.
    """
    reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=reliability)


def stage(depth: int = 20) -> QoSProfile:
    """The QoS between the nodes: small and reliable."""
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=ReliabilityPolicy.RELIABLE)


def latched(depth: int = 1) -> QoSProfile:
    """What a late subscriber must still get: the last ``depth`` messages."""
    profile = stage(depth)
    profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile
