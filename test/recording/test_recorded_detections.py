# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin

from objreg_ros.bridge.messages import vision_from_msg
from objreg_tools.recording import open_recording
from objreg_tools.recording.record import Topic
from objreg_tools.recording.recorded_detections import BOXES, NAMES, choose_detections, recorded_detections

from .vision import detected_bag

IMAGE = "sensor_msgs/msg/Image"


def topics(**kinds: str) -> dict[str, Topic]:
    """``a__b=BOXES``: a topic /a/b."""
    named = {f"/{name.replace('__', '/')}": kind for name, kind in kinds.items()}
    return {name: Topic(name, kind, 3) for name, kind in named.items()}


def test_boxes_go_before_masks_and_pictures_of_other_names_are_none() -> None:
    there = topics(
        camera__image=IMAGE, sam__masks=IMAGE, yolo__boxes=BOXES, instance_segmentation=IMAGE, unmasked__image=IMAGE
    )
    assert [one.topic for one in recorded_detections(there)] == ["/yolo/boxes", "/instance_segmentation", "/sam/masks"]


def test_the_names_are_those_of_the_same_detector() -> None:
    there = topics(a__yolo__boxes=BOXES, label_info=NAMES, a__yolo__label_info=NAMES, b__label_info=NAMES)
    (found,) = recorded_detections(there)
    assert found.topics == {"/a/yolo/boxes": "detections", "/a/yolo/label_info": "label_info"}
    assert recorded_detections(topics(boxes=BOXES))[0].names is None


def test_an_empty_topic_holds_no_detections() -> None:
    assert recorded_detections({"/boxes": Topic("/boxes", BOXES, 0)}) == []


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_boxes_of_a_bag_are_read_by_its_own_definitions(storage: StoragePlugin, tmp_path: Path) -> None:
    with open_recording(detected_bag(tmp_path / "bag", 2, storage)) as recording:
        chosen = choose_detections(recording, "/yolo/detections")
        assert chosen.names == "/yolo/label_info"
        read = {kind: next(recording.records([topic])).message for topic, kind in chosen.topics.items()}
        named = vision_from_msg.label_info(read["label_info"])
        found = vision_from_msg.detections(read["detections"], named, (48, 64))
    assert (found.xyxy.tolist(), found.label, found.ids) == ([[20, 12, 40, 24]], ("mug",), ("7",))


def test_what_holds_no_detections_is_refused_with_what_does(tmp_path: Path) -> None:
    with open_recording(detected_bag(tmp_path / "bag", 1)) as recording:
        assert choose_detections(recording, "/yolo/instance_masks").topic == "/yolo/instance_masks"
        there = "/yolo/detections, /yolo/instance_masks"
        with pytest.raises(ValueError, match=rf"topic of the recording \(of detections: {there}\), got '/nowhere'"):
            choose_detections(recording, "/nowhere")
        with pytest.raises(ValueError, match=rf"\(there: {there}\), got /odom \(nav_msgs/msg/Odometry\)"):
            choose_detections(recording, "/odom")


def without_definitions(bag: Path) -> Path:
    """The bag as a recorder of Humble would have written it."""
    with sqlite3.connect(next(bag.glob("*.db3"))) as storage:
        storage.execute("DELETE FROM message_definitions")
    return bag


def test_a_bag_of_humble_without_definitions_is_read_and_says_how(tmp_path: Path) -> None:
    bag = without_definitions(detected_bag(tmp_path / "bag", 2, StoragePlugin.SQLITE3))
    with open_recording(bag) as recording:
        chosen = choose_detections(recording, "/yolo/detections")
        message = next(recording.records([chosen.topic])).message
        assert vision_from_msg.detections(message, {4: "mug"}, (48, 64)).label == ("mug",)
        (note,) = recording.notes
    assert note == f"the bag does not define {BOXES}, {NAMES}: read as vision_msgs of version 3 or 4 has it"


def test_the_definitions_of_the_bag_itself_count(tmp_path: Path) -> None:
    with open_recording(detected_bag(tmp_path / "bag", 2, StoragePlugin.SQLITE3)) as recording:
        assert recording.notes == []
