# SPDX-License-Identifier: Apache-2.0
"""RTAB-Map: the service ``add_link`` (rtabmap_msgs/AddLink) and the topic ``landmark_detections``.

Links tie the base frames of two of its own nodes: ``mapData`` has their ids and stamps, `between_keyframes` the
constraint. A landmark is a point in the camera, whose optical frame the detection's header must name, for RTAB-Map
looks up in TF where that is on the base frame; its rotation is left open.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from objreg_mapper.constraint import Constraint, local_information
from objreg_mapper.formats.pose import fill_pose
from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose

USER_CLOSURE, NO_ROTATION = 4, 9999.0  # type 0 or 99 aborts RTAB-Map; a variance from here on says "unknown"


def fill_link(link: Any, constraint: Constraint, from_id: int, to_id: int) -> Any:
    """The Link of a ``constraint`` between the base frames of two nodes, with its information, translation first.

    ValueError for what RTAB-Map aborts on.
    """
    information = local_information(constraint)
    if from_id == to_id or not np.all(np.diag(information) > 0):  # also refuses NaN
        raise ValueError(f"expected two nodes and a positive diagonal, got {from_id}, {to_id}, {np.diag(information)}")
    link.from_id, link.to_id, link.type = from_id, to_id, USER_CLOSURE
    fill_pose(link.transform.translation, link.transform.rotation, constraint.T_from_to)
    link.information = information.ravel().tolist()
    return link


def fill_landmark(detection: Any, object_id: int, xyz: Array, sigma: float) -> Any:
    """The LandmarkDetection of ``xyz (3,)`` m in the frame of its header, ``sigma`` m certain.

    ValueError for an id below 1, and for a ``sigma`` that is none: RTAB-Map would put its own in its place.
    """
    if object_id < 1:
        raise ValueError(f"expected a landmark's id of at least 1, got {object_id}")
    if not 0 < sigma < np.inf:
        raise ValueError(f"expected a landmark's sigma above 0 m, got {sigma}")
    detection.id = object_id
    fill_pose(detection.pose.pose.position, detection.pose.pose.orientation, pose(np.eye(3), xyz))
    detection.pose.covariance = np.diag([sigma**2] * 3 + [NO_ROTATION] * 3).ravel().tolist()
    return detection
