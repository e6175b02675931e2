# SPDX-License-Identifier: Apache-2.0
"""The id of a closure, which lasts: it is made of the two moments."""

from __future__ import annotations

import json
import uuid

from objreg_ros.data.closures import LoopClosure

NAMESPACE = uuid.UUID("5b0f7f86-7a43-4d0b-9c53-0a1de0f6b0c7")  # of the ids of closures
IDENTITY = "from_frame_id", "from_ns", "to_frame_id", "to_ns", "from_robot", "to_robot", "from_session", "to_session"

Identity = tuple[str, int, str, int, str, str, int | None, int | None]  # the fields of `IDENTITY`


def identity_of(closure: LoopClosure) -> Identity:
    """What makes a closure another: moments, robots and sessions."""
    return *closure.moments, *closure.robots, closure.from_session, closure.to_session


def closure_id(closure: LoopClosure, robot: str = "") -> str:
    """The text of a UUID: the same for the same two keyframes of the same robots, wherever and whenever it is made.

    Where the closure names no robot, ``robot`` is its robot: the namespace of the registrar that found it.
    """
    return id_of(identity_of(closure), robot)


def id_of(identity: Identity, robot: str = "") -> str:
    """The `closure_id` of a closure with this identity."""
    from_frame_id, from_ns, to_frame_id, to_ns, from_robot, to_robot, from_session, to_session = identity
    here, there = (from_session, from_frame_id, from_ns), (to_session, to_frame_id, to_ns)
    robots = from_robot or robot, to_robot or robot
    whose = robots[0] if robots[0] == robots[1] else robots
    return str(uuid.uuid5(NAMESPACE, json.dumps([whose, *here, *there])))
