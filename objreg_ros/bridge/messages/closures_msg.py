# SPDX-License-Identifier: Apache-2.0
"""Closures, refusals and landmarks as the messages of objreg_msgs, with all that is known of them, and back.

Every function is pure. What a field means is in the .msg files. Where objreg_msgs is not installed, what makes a
message gives None. What reads one takes its attributes only, so the messages of rosbags fit too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.bridge.messages import headers, motion_from_msg, to_msg
from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Observation, Reason, Rejected, Robots

try:
    from objreg_msgs.msg import Evidence, Moment, ObjectLandmark, ObjectLandmarks, Refusal
    from objreg_msgs.msg import LoopClosure as LoopClosureMsg
    from objreg_msgs.msg import ObjectMatch as ObjectMatchMsg
except ImportError:  # optional: the topics of common_interfaces carry the poses
    LoopClosureMsg = Refusal = ObjectLandmarks = None

NO_CLASS = 65535  # class_id of a label that has no number
SESSION = re.compile("[0-9]{1,18}")


def loop_closure(closure: LoopClosure, robot: str = "") -> Any:
    """An objreg_msgs/LoopClosure; None where objreg_msgs is not installed.

    Where the closure names no robot, ``robot`` is its robot.
    """
    if LoopClosureMsg is None:
        return None
    robots = _robots(closure, robot)
    message = LoopClosureMsg(
        header=to_msg.header(closure.to_ns, closure.from_frame_id),
        id=closure_id(closure, robot),
        from_moment=_moment(closure.from_ns, closure.from_frame_id, closure.from_session, robots[0]),
        to_moment=_moment(closure.to_ns, closure.to_frame_id, closure.to_session, robots[1]),
        labels=list(closure.labels),
        objects=[ObjectMatchMsg(label=match.label, landmark_id=match.object_id) for match in closure.objects],
        evidence=_evidence(closure.evidence),
    )
    message.pose.pose = to_msg.pose(closure.T_from_to)
    message.pose.covariance = closure.covariance.ravel()
    return message


def retraction(closure: LoopClosure, robot: str = "") -> Any:
    """The message that withdraws a closure, with all that it said; None where objreg_msgs is not installed."""
    message = loop_closure(closure, robot)
    if message is not None:
        message.retracted = True
    return message


def refusal(rejected: Rejected, robot: str = "") -> Any:
    """An objreg_msgs/Refusal, with robots as in `loop_closure`; None where objreg_msgs is not installed."""
    if Refusal is None:
        return None
    T, robots = rejected.T_from_to, _robots(rejected, robot)
    message = Refusal(
        header=to_msg.header(rejected.to_ns, rejected.from_frame_id),
        from_moment=_moment(rejected.from_ns, rejected.from_frame_id, rejected.from_session, robots[0]),
        to_moment=_moment(rejected.to_ns, rejected.to_frame_id, rejected.to_session, robots[1]),
        reason=rejected.reason.value,
        detail=rejected.detail,
        evidence=_evidence(rejected.evidence),
        has_pose=T is not None,
    )
    if T is not None:
        message.pose = to_msg.pose(T)
    return message


def object_landmarks(
    observations: Sequence[Observation],
    stamp_ns: int,
    frame_id: str,
    names: to_msg.Labels,
    session: int | None = None,
    robot: str = "",
) -> Any:
    """The objects of a keyframe as an objreg_msgs/ObjectLandmarks; None where objreg_msgs is not installed."""
    if ObjectLandmarks is None:
        return None
    return ObjectLandmarks(
        header=to_msg.header(stamp_ns, frame_id),
        robot=robot,
        session=_text(session),
        landmarks=[_landmark(seen, to_msg.class_id(seen.label, names)) for seen in observations],
    )


def _landmark(seen: Observation, class_id: int | None) -> Any:
    message = ObjectLandmark(id=seen.object_id, label=seen.label, class_id=NO_CLASS if class_id is None else class_id)
    message.position.x, message.position.y, message.position.z = seen.xyz.tolist()
    return message


def _robots(closure: LoopClosure | Rejected, robot: str) -> Robots:
    return closure.from_robot or robot, closure.to_robot or robot


def _moment(stamp_ns: int, frame_id: str, session: int | None, robot: str) -> Any:
    return Moment(stamp=to_msg.stamp(stamp_ns), frame_id=frame_id, robot=robot, session=_text(session))


def _text(session: int | None) -> str:
    return "" if session is None else str(session)


def _evidence(numbers: Mapping[str, float]) -> list[Any]:
    return [Evidence(name=name, value=float(value)) for name, value in numbers.items()]


# Back


def read_loop_closure(message: Any) -> LoopClosure:
    """The closure in an objreg_msgs/LoopClosure. ValueError for a retraction, which has none."""
    if message.retracted:
        raise ValueError(f"closure: expected one that holds, got the retraction of {message.id[:40]!r}")
    _require_few(message.labels, "labels", limits.MOST_OBJECTS)
    _require_few(message.objects, "objects", limits.MOST_OBJECTS)
    return LoopClosure(
        T_from_to=motion_from_msg.motion(message),
        covariance=np.asarray(message.pose.covariance, np.float64).reshape(6, 6),
        labels=tuple(headers.bounded(label, "label") for label in message.labels),
        objects=tuple(
            ObjectMatch(label=headers.bounded(match.label, "label"), object_id=int(match.landmark_id))
            for match in message.objects
        ),
        evidence=_numbers(message.evidence),
        **_ends(message),
    )


def read_refusal(message: Any) -> Rejected:
    """The refusal in an objreg_msgs/Refusal. ValueError for an unknown reason."""
    return Rejected(
        reason=Reason(message.reason),
        detail=headers.bounded(message.detail, "detail", limits.MOST_DETAIL),
        T_from_to=motion_from_msg.motion(message) if message.has_pose else None,
        evidence=_numbers(message.evidence),
        **_ends(message),
    )


def read_landmarks(message: Any) -> tuple[Observation, ...]:
    """The objects in an objreg_msgs/ObjectLandmarks, in the camera frame and at the time of its header."""
    _require_few(message.landmarks, "landmarks", limits.MOST_OBJECTS)
    return tuple(
        Observation(
            label=headers.bounded(item.label, "label"),
            object_id=int(item.id),
            xyz=np.array([item.position.x, item.position.y, item.position.z], float),
        )
        for item in message.landmarks
    )


def _ends(message: Any) -> dict[str, Any]:
    """Stamp, frame, session and robot of both keyframes, as fields of a value."""
    fields: dict[str, Any] = {}
    for end, moment in (("from", message.from_moment), ("to", message.to_moment)):
        fields[f"{end}_ns"] = headers.stamp_ns(moment)
        fields[f"{end}_frame_id"] = headers.bounded(moment.frame_id, "frame_id")
        fields[f"{end}_session"] = _session(moment.session)
        fields[f"{end}_robot"] = headers.bounded(moment.robot, "robot")
    return fields


def _session(text: str) -> int | None:
    if not text:
        return None
    if SESSION.fullmatch(text) is None:
        raise ValueError(f"session: expected a number of at most 18 digits or nothing, got {text[:40]!r}")
    return int(text)


def _numbers(evidence: Sequence[Any]) -> dict[str, float]:
    _require_few(evidence, "evidence", limits.MOST_EVIDENCE)
    return {headers.bounded(item.name, "evidence"): float(item.value) for item in evidence}


def _require_few(items: Sequence[Any], of: str, most: int) -> None:
    if len(items) > most:
        raise ValueError(f"{of}: expected at most {most}, got {len(items)}")
