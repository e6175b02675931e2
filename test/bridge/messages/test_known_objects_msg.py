# SPDX-License-Identifier: Apache-2.0
"""The answer of objreg_msgs/Where."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.bridge.messages import known_objects_msg

LANDMARK = SimpleNamespace(landmark=7, label="chair", session=3, stamp_ns=5_000_000_002, sightings=4)
CHAIR = SimpleNamespace(
    landmark=LANDMARK, xyz=np.array([1.0, 2.0, 0.5]), covariance=np.arange(9.0).reshape(3, 3), extent=0.9
)
FOUND = SimpleNamespace(objects=(CHAIR,), session=4, message="1 here")


def assert_is_the_chair(response: Any) -> None:
    assert response.success and response.message == "1 here" and response.session == "4" and response.robot == "r1"
    assert response.header.frame_id == "odom" and response.header.stamp.sec == 5 and response.header.stamp.nanosec == 2
    (place,) = response.landmarks
    assert (place.landmark.id, place.landmark.label, place.sightings, place.session) == (7, "chair", 4, "3")
    at = place.landmark.position
    assert (at.x, at.y, at.z, place.extent) == (1.0, 2.0, 0.5, 0.9) and place.last_seen.nanosec == 2
    assert list(place.landmark.position_covariance) == list(range(9))


def test_the_answer_has_what_is_known_of_each_object(monkeypatch: pytest.MonkeyPatch) -> None:
    def landmark(**fields: Any) -> Any:
        return SimpleNamespace(position=SimpleNamespace(), **fields)

    monkeypatch.setattr(known_objects_msg, "ObjectLandmark", landmark)
    monkeypatch.setattr(known_objects_msg, "LandmarkPlace", SimpleNamespace)
    assert_is_the_chair(known_objects_msg.fill(SimpleNamespace(), FOUND, "odom", "r1"))


def test_a_message_of_objreg_msgs_takes_it() -> None:
    if known_objects_msg.Where is None:
        pytest.skip("objreg_msgs is not installed: colcon builds it from this repository")
    assert_is_the_chair(known_objects_msg.fill(known_objects_msg.Where.Response(), FOUND, "odom", "r1"))


def test_nothing_that_was_found_is_no_success() -> None:
    nothing = SimpleNamespace(objects=(), session=None, message="no sofa is known")
    response = known_objects_msg.fill(SimpleNamespace(), nothing, "odom", "")
    assert not response.success and response.message == "no sofa is known" and response.landmarks == []
    assert response.session == "" and response.header.stamp.sec == 0
