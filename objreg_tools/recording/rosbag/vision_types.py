# SPDX-License-Identifier: Apache-2.0
"""The message types of vision_msgs, for bags that hold such messages without their definitions.

Up to Humble a rosbag2 in sqlite3 has no definitions, and `rosbags` ships none of vision_msgs. Versions 3 and 4, from
Galactic on, have the same bytes. Those of version 2 (Foxy) are longer, and so are refused where a message is read.
"""

from __future__ import annotations

from collections.abc import Iterable

from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

PACKAGE = "vision_msgs/msg/"
DEFINITIONS = {
    "Point2D": "float64 x\nfloat64 y",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "Detection2D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox2D bbox\nstring id",
    "Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
    "VisionClass": "uint16 class_id\nstring class_name",
    "LabelInfo": "std_msgs/Header header\nvision_msgs/VisionClass[] class_map\nfloat32 threshold",
}


def define_vision(types: Typestore, used: Iterable[str]) -> list[str]:
    """Add what ``types`` lacks of vision_msgs where a bag ``used`` it; the names of the used types that it lacked.

    None where the bag brought any definition of the package: then it is of that version.
    """
    lacking = sorted(name for name in set(used) - set(types.fielddefs) if name.removeprefix(PACKAGE) in DEFINITIONS)
    if not lacking or any(name.startswith(PACKAGE) for name in types.fielddefs):
        return []
    for name, text in DEFINITIONS.items():
        types.register(get_types_from_msg(text, f"{PACKAGE}{name}"))
    return lacking
