# SPDX-License-Identifier: Apache-2.0
"""Boxes and objects as vision_msgs."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bridge.messages.test_to_msg import STAMP, cloud_of, frame_of
from objreg_ros.bridge.messages import headers, vision_from_msg, vision_to_msg
from objreg_ros.data.images import Detections


@pytest.fixture
def types(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where vision_msgs is not installed, stubs with the same fields stand in."""
    if vision_to_msg.Detection2DArray is not None:
        return

    def made(**fields: object) -> SimpleNamespace:
        bbox = SimpleNamespace(center=SimpleNamespace(position=SimpleNamespace(), theta=0.0))
        usual = {"bbox": bbox, "results": [], "detections": [], "id": ""}
        return SimpleNamespace(hypothesis=SimpleNamespace(), pose=SimpleNamespace(), **{**usual, **fields})

    for name in ("Detection2D", "Detection2DArray", "Detection3D", "Detection3DArray", "ObjectHypothesisWithPose"):
        monkeypatch.setattr(vision_to_msg, name, made, raising=False)


def boxes() -> Detections:
    xyxy, score = np.array([[10, 20, 40, 100]], np.float32), np.array([0.5], np.float32)
    return Detections(
        xyxy=xyxy, score=score, label=("tv",), image_hw=(480, 640), stamp_ns=STAMP, frame_id="kinect", ids=("7",)
    )


def test_a_box_has_its_middle_its_size_and_its_name(types: None) -> None:
    message = vision_to_msg.detections(boxes())
    (found,) = message.detections
    (result,) = found.results
    assert (found.bbox.center.position.x, found.bbox.center.position.y) == (25.0, 60.0)
    assert (found.bbox.size_x, found.bbox.size_y) == (30.0, 80.0)
    assert (result.hypothesis.class_id, result.hypothesis.score, found.id) == ("tv", 0.5, "7")
    assert headers.stamp_ns(message) == headers.stamp_ns(found) == STAMP


def test_boxes_come_back_as_they_went(types: None) -> None:
    sent = boxes()
    back = vision_from_msg.boxes(vision_to_msg.detections(sent), {}, sent.image_hw)
    assert np.allclose(back.xyxy, sent.xyxy) and back.label == sent.label and back.ids == sent.ids
    assert (back.stamp_ns, back.frame_id) == (sent.stamp_ns, sent.frame_id)


def test_an_object_is_the_box_around_what_was_seen_of_it(types: None) -> None:
    cup = cloud_of("cup", 2, 5)
    (found,) = vision_to_msg.objects(frame_of(cup)).detections
    low, high = cup.xyz.min(axis=0), cup.xyz.max(axis=0)
    middle, size = found.bbox.center.position, found.bbox.size
    assert [middle.x, middle.y, middle.z] == pytest.approx(((low + high) / 2).tolist(), abs=1e-6)
    assert [size.x, size.y, size.z] == pytest.approx((high - low).tolist(), abs=1e-6)
    assert (found.results[0].hypothesis.class_id, found.id) == ("cup", "2")


def test_an_object_keeps_the_name_that_its_detector_gave_it(types: None) -> None:
    (found,) = vision_to_msg.objects(frame_of(replace(cloud_of("cup", 2, 5), detection_id="track 9"))).detections
    assert found.id == "track 9"
