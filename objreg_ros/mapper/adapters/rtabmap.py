# SPDX-License-Identifier: Apache-2.0
"""RTAB-Map: the service ``add_link`` (rtabmap_msgs/AddLink) and the topic ``landmark_detections``.

Links tie two of its own nodes, which stand at their base frame and appear about once a second: take ids and stamps from
``mapData`` and the constraint from `constraint.between_keyframes`. The reply is empty.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import quaternion_from_rotation
from objreg_ros.mapper.constraint import Constraint, local_information

USER_CLOSURE = 4  # 0 (neighbour) and 99 (undefined) abort RTAB-Map
NO_ROTATION = 9999.0  # a rotation variance from here on makes a landmark a point


def fill_link(link: Any, constraint: Constraint, from_id: int, to_id: int) -> Any:
    """The Link between two nodes: their ids, ``T_from_to`` and the information, translation first.

    ValueError for a node tied to itself, and for a diagonal that RTAB-Map aborts on.
    """
    information = local_information(constraint)
    if not np.all(np.diag(information) > 0):  # also refuses NaN
        raise ValueError(f"expected a positive diagonal of the information, got {np.diag(information).tolist()}")
    if from_id == to_id:
        raise ValueError(f"expected two nodes, got node {from_id} twice")
    link.from_id, link.to_id, link.type = from_id, to_id, USER_CLOSURE
    where, turn = link.transform.translation, link.transform.rotation
    where.x, where.y, where.z = map(float, constraint.T_from_to[:3, 3])
    turn.x, turn.y, turn.z, turn.w = map(float, quaternion_from_rotation(constraint.T_from_to[:3, :3]))
    link.information = information.ravel().tolist()
    return link


def fill_landmark(detection: Any, object_id: int, xyz: Array, sigma: float) -> Any:
    """The LandmarkDetection of an object seen at ``xyz (3,)`` m, within ``sigma`` m, in the header's camera frame.

    An object is a point to RTAB-Map: its rotation is left open. ValueError for an id below 1, which it does not take.
    """
    if object_id < 1:
        raise ValueError(f"expected a landmark's id of at least 1, got {object_id}")
    detection.id = object_id
    where, turn = detection.pose.pose.position, detection.pose.pose.orientation
    where.x, where.y, where.z = map(float, xyz)
    turn.x, turn.y, turn.z, turn.w = 0.0, 0.0, 0.0, 1.0
    detection.pose.covariance = np.diag([sigma**2] * 3 + [NO_ROTATION] * 3).ravel().tolist()
    return detection
