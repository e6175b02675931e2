# SPDX-License-Identifier: Apache-2.0
"""The id of a closure, which lasts: it is made of the two moments."""

from __future__ import annotations

import json
import uuid

from objreg_ros.data.closures import LoopClosure

NAMESPACE = uuid.UUID("5b0f7f86-7a43-4d0b-9c53-0a1de0f6b0c7")  # of the ids of closures


def closure_id(closure: LoopClosure, robot: str = "") -> str:
    """The text of a UUID: the same for the same two keyframes of the same robots, wherever and whenever it is made.

    Where the closure names no robot, ``robot`` is its robot: the namespace of the registrar that found it.
    """
    here = closure.from_session, closure.from_frame_id, closure.from_ns
    there = closure.to_session, closure.to_frame_id, closure.to_ns
    robots = closure.from_robot or robot, closure.to_robot or robot
    whose = robots[0] if robots[0] == robots[1] else robots
    return str(uuid.uuid5(NAMESPACE, json.dumps([whose, *here, *there])))
