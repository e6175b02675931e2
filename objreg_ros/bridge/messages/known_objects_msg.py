# SPDX-License-Identifier: Apache-2.0
"""Where objects are, as the answer of objreg_msgs/Where. Where objreg_msgs is not installed, there is no `Where`."""

from __future__ import annotations

from typing import Any

from objreg_ros.bridge.messages import closures_msg, to_msg

try:
    from objreg_msgs.msg import LandmarkPlace, ObjectLandmark
    from objreg_msgs.srv import Where
except ImportError:  # optional: no message of common_interfaces asks by a label
    Where = LandmarkPlace = ObjectLandmark = None


def fill(response: Any, found: Any, frame_id: str, robot: str) -> Any:
    """The response with the registrar's `KnownObjects`, in the frame ``frame_id`` of the odometry of ``robot``."""
    response.success, response.message = bool(found.objects), found.message
    last_ns = max((item.landmark.stamp_ns for item in found.objects), default=0)
    response.header = to_msg.header(last_ns, frame_id)
    response.robot, response.session = robot, "" if found.session is None else str(found.session)
    response.landmarks = [_place(item) for item in found.objects]
    return response


def _place(item: Any) -> Any:
    known = item.landmark
    landmark = ObjectLandmark(id=known.landmark, label=known.label, class_id=closures_msg.NO_CLASS)
    landmark.position.x, landmark.position.y, landmark.position.z = item.xyz.tolist()
    landmark.position_covariance = item.covariance.ravel()
    return LandmarkPlace(
        landmark=landmark,
        extent=item.extent,
        sightings=known.sightings,
        last_seen=to_msg.stamp(known.stamp_ns),
        session=str(known.session),
    )
