# SPDX-License-Identifier: Apache-2.0
"""Boxes and objects as vision_msgs, for whoever reads those; the other direction is `vision_from_msg`.

vision_msgs is no part of common_interfaces. Where it is absent the types are None, and no topic of theirs is opened.
"""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Point, Pose, Vector3
from std_msgs.msg import Header

from objreg_ros.bridge.messages.to_msg import header
from objreg_ros.data.frames import Frame, ObjectCloud
from objreg_ros.data.images import Detections

try:
    from vision_msgs.msg import (
        Detection2D,
        Detection2DArray,
        Detection3D,
        Detection3DArray,
        LabelInfo,
        ObjectHypothesisWithPose,
    )
except ImportError:
    Detection2DArray = Detection3DArray = LabelInfo = None


def detections(found: Detections) -> Any:
    """A Detection2DArray; ``class_id`` is the label, ``id`` the detector's own where it has one."""
    message = Detection2DArray(header=header(found.stamp_ns, found.frame_id))
    ids = found.ids or ("",) * len(found)
    for box, score, label, name in zip(found.xyxy.tolist(), found.score.tolist(), found.label, ids, strict=True):
        message.detections.append(_box(box, score, label, name, message.header))
    return message


def _box(xyxy: list[float], score: float, label: str, name: str, head: Header) -> Any:
    x_min, y_min, x_max, y_max = xyxy
    detection = Detection2D(header=head, id=name)
    detection.bbox.center.position.x, detection.bbox.center.position.y = (x_min + x_max) / 2, (y_min + y_max) / 2
    detection.bbox.size_x, detection.bbox.size_y = x_max - x_min, y_max - y_min
    detection.results.append(_hypothesis(label, score))
    return detection


def _hypothesis(label: str, score: float) -> Any:
    said = ObjectHypothesisWithPose()
    said.hypothesis.class_id, said.hypothesis.score = label, score
    return said


def objects(frame: Frame) -> Any:
    """The objects of a frame as a Detection3DArray: boxes along the axes of the camera around what was seen of each.

    ``id`` is the detector's own, and where it has none the number of the object in ``objects``.
    """
    message = Detection3DArray(header=header(frame.stamp_ns, frame.frame_id))
    message.detections = [_solid(cloud, message.header) for cloud in frame.objects]
    return message


def _solid(cloud: ObjectCloud, head: Header) -> Any:
    low, high = cloud.xyz.min(axis=0).astype(float), cloud.xyz.max(axis=0).astype(float)
    detection = Detection3D(header=head, id=cloud.detection_id or str(cloud.instance))
    middle, size = ((low + high) / 2).tolist(), (high - low).tolist()
    detection.bbox.center = Pose(position=Point(**dict(zip("xyz", middle, strict=True))))
    detection.bbox.size = Vector3(**dict(zip("xyz", size, strict=True)))
    said = _hypothesis(cloud.label, cloud.score)
    said.pose.pose = detection.bbox.center
    detection.results.append(said)
    return detection
