# SPDX-License-Identifier: Apache-2.0
"""What other detectors say: boxes of vision_msgs, and pictures of masks."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bridge.sample_messages import camera_info, header, image
from objreg_ros.bridge.messages import vision_from_msg
from objreg_ros.data.frames import UNNAMED

HW = (100, 200)


def box(
    x: float, y: float, w: float, h: float, *said: tuple[str, float], theta: float = 0.0, name: str = ""
) -> SimpleNamespace:
    """A Detection2D of vision_msgs 4."""
    center = SimpleNamespace(position=SimpleNamespace(x=x, y=y), theta=theta)
    results = [SimpleNamespace(hypothesis=SimpleNamespace(class_id=label, score=score)) for label, score in said]
    return SimpleNamespace(bbox=SimpleNamespace(center=center, size_x=w, size_y=h), results=results, id=name)


def array(*detections: Any) -> SimpleNamespace:
    return SimpleNamespace(header=header(7, "eye"), detections=list(detections))


def test_boxes_come_best_first_with_their_names_and_what_the_detector_calls_them() -> None:
    message = array(box(50, 40, 20, 10, ("cup", 0.4), name="a"), box(100, 50, 40, 60, ("tv", 0.9), name="b"))
    found = vision_from_msg.boxes(message, {}, HW)
    assert found.xyxy.tolist() == [[80, 20, 120, 80], [40, 35, 60, 45]]
    assert (
        found.score.tolist() == pytest.approx([0.9, 0.4]) and found.label == ("tv", "cup") and found.ids == ("b", "a")
    )
    assert (found.image_hw, found.stamp_ns, found.frame_id) == (HW, 7, "eye")


def test_the_messages_of_ros_1_are_understood() -> None:
    old = box(50, 40, 20, 10, ("cup", 0.4))
    old.results = [SimpleNamespace(id=4, score=0.4), SimpleNamespace(id=5, score=0.2)]
    old.bbox.center = SimpleNamespace(x=50.0, y=40.0, theta=0.0)
    del old.id
    found = vision_from_msg.boxes(array(old), {4: "mug"}, HW)
    assert (found.label, found.ids, found.xyxy.tolist()) == (("mug",), ("",), [[40, 35, 60, 45]])


def test_boxes_and_pictures_of_masks_are_kept_apart() -> None:
    assert vision_from_msg.detections(array(box(50, 40, 20, 10, ("cup", 1.0))), {}, HW).image_hw == HW
    numbers = np.zeros((6, 8), np.uint8)
    numbers[2:4, 1:5] = 4
    found = vision_from_msg.detections(image(numbers, "mono8"), {4: "mug"}, HW)
    assert (found.image_hw, found.label, found.xyxy.tolist()) == ((6, 8), ("mug",), [[1, 2, 5, 4]])
    with pytest.raises(ValueError, match="expected at most 40 pixels"):
        vision_from_msg.detections(image(numbers, "mono8"), {}, HW, most_pixels=40)


def test_boxes_are_in_the_picture_or_else_in_that_of_its_camera() -> None:
    camera = camera_info([50.0, 0, 31.5, 0, 50.0, 23.5, 0, 0, 1], 64, 48)
    raw, packed = image(np.zeros((6, 8), np.uint8), "mono8"), SimpleNamespace(format="jpeg", data=b"")
    assert vision_from_msg.picture_hw(raw, camera) == vision_from_msg.picture_hw(raw, None) == (6, 8)
    assert vision_from_msg.picture_hw(packed, camera) == vision_from_msg.picture_hw(None, camera) == (48, 64)
    assert vision_from_msg.picture_hw(None, None) is None


def test_a_picture_without_objects_has_no_boxes() -> None:
    assert len(vision_from_msg.boxes(array(), {}, HW)) == 0


def test_boxes_are_clipped_to_the_picture() -> None:
    found = vision_from_msg.boxes(array(box(0, 100, 60, 40, ("cup", 1.0))), {}, HW)
    assert found.xyxy.tolist() == [[0, 80, 30, 100]]


def test_the_upright_box_around_a_turned_one_is_taken() -> None:
    found = vision_from_msg.boxes(array(box(100, 50, 40, 20, ("cup", 1.0), theta=math.pi / 2)), {}, HW)
    assert found.xyxy[0].tolist() == pytest.approx([90, 30, 110, 70], abs=1e-4)


def test_the_middle_of_older_vision_msgs_is_understood() -> None:
    old = box(0, 0, 20, 10, ("cup", 1.0))
    old.bbox.center = SimpleNamespace(x=50.0, y=40.0, theta=0.0)
    assert vision_from_msg.boxes(array(old), {}, HW).xyxy.tolist() == [[40, 35, 60, 45]]


@pytest.mark.parametrize(
    ("said", "label"),
    [("cup", "cup"), ("41", "mug"), ("7", "7"), ("", UNNAMED), ("9" * 900, "9" * 900), ("-1", "-1"), ("²", "²")],
)
def test_a_class_is_a_name_or_a_number_that_may_have_one(said: str, label: str) -> None:
    found = vision_from_msg.boxes(array(box(50, 40, 20, 10, (said, 0.5))), {41: "mug"}, HW)
    assert found.label == (label,)


def test_the_best_hypothesis_counts_and_a_box_without_any_is_of_no_class() -> None:
    message = array(box(50, 40, 20, 10, ("cup", 0.2), ("bowl", 0.6)), box(50, 40, 20, 10))
    found = vision_from_msg.boxes(message, {}, HW)
    assert found.label == ("bowl", UNNAMED) and found.score.tolist() == pytest.approx([0.6, 0.0])


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (box(math.nan, 0, 1, 1, ("cup", 0.5)), "expected a finite box"),
        (box(0, 0, -1, 1, ("cup", 0.5)), "a size not below 0"),
        (box(0, 0, 1, 1, ("cup", 80.0)), "expected scores of 0 to 1, got 80.0"),
        (box(0, 0, 1, 1, ("cup", math.nan)), "expected scores of 0 to 1, got nan"),
        (box(0, 0, 1, 1, ("c" * 1001, 0.5)), "expected at most 1000 characters"),
        (box(0, 0, 1, 1, ("\ud800", 0.5)), "a name that UTF-8 can write"),
    ],
)
def test_a_box_that_cannot_be_is_refused_with_what_was_expected(wrong: Any, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        vision_from_msg.boxes(array(wrong), {}, HW)


def test_more_boxes_than_a_picture_can_have_are_refused_before_any_is_read() -> None:
    with pytest.raises(ValueError, match="at most 1000 boxes, got 1001"):
        vision_from_msg.boxes(array(*[None] * 1001), {}, HW)


def test_a_label_info_gives_names_to_numbers() -> None:
    classes = [SimpleNamespace(class_id=1, class_name="cup"), SimpleNamespace(class_id=300, class_name="tv")]
    assert vision_from_msg.label_info(SimpleNamespace(class_map=classes)) == {1: "cup", 300: "tv"}


def test_every_number_in_a_picture_of_masks_is_an_instance() -> None:
    numbers = np.zeros(HW, np.uint16)
    numbers[10:20, 30:50], numbers[15, 60], numbers[70:90, 5:9] = 3, 3, 65535
    found = vision_from_msg.instances(numbers, {3: "cup"}, 7, "eye")
    assert found.xyxy.tolist() == [[30, 10, 61, 20], [5, 70, 9, 90]]
    assert found.label == ("cup", UNNAMED) and found.ids == ("3", "65535")
    assert found.instances is not None and np.bincount(found.instances.ravel())[1:].tolist() == [201, 80]
    assert (found.instances[70:90, 5:9] == 2).all()


def test_an_empty_picture_of_masks_has_no_instances() -> None:
    found = vision_from_msg.instances(np.zeros(HW, np.uint16), {}, 7, "eye")
    assert len(found) == 0 and found.instances is not None and not found.instances.any()


def test_more_masks_than_a_picture_has_things_are_refused() -> None:
    numbers = np.arange(HW[0] * HW[1], dtype=np.uint16).reshape(HW) % 1002
    with pytest.raises(ValueError, match="expected at most 1000 instances, got 1001"):
        vision_from_msg.instances(numbers, {}, 7, "eye")
