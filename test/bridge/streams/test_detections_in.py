# SPDX-License-Identifier: Apache-2.0
"""Detections by whichever topic they come, behind a node that only notes what is asked of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import Image

from objreg_ros.bridge.messages import from_msg, to_msg
from objreg_ros.bridge.streams import detections_in
from objreg_ros.bridge.streams.detections_in import DetectionsIn
from objreg_ros.bridge.streams.sync import Drop, Match
from objreg_ros.data.frames import UNNAMED
from objreg_ros.data.images import DepthImage, Detections, Intrinsics

CAMERA = Intrinsics(fx=60.0, fy=60.0, cx=40.0, cy=30.0, width=80, height=60)
DEPTH = DepthImage(depth=np.ones((60, 80), np.float32), rgb=None, intrinsics=CAMERA, stamp_ns=5)
NAMES = {0: "cup", 1: "tv"}


class NodeBase:
    """Notes what it is fed and what is published."""

    most_pixels = 10_000

    def __init__(self) -> None:
        self.fed: list[tuple[str, int, Any]] = []
        self.published: list[Any] = []
        self.acknowledged: list[int] = []
        self.topics: dict[str, type] = {}
        self.received: dict[str, Callable[[Any], None]] = {}

    def listen(self, _kind: type, topic: str, received: Callable[[Any], None], _profile: Any) -> None:
        self.received[topic] = received

    def listen_to_first(self, _name: str, topics: dict[str, type], decode: Any, received: Any, *_profiles: Any) -> None:
        self.topics, self.decode, self.receive = topics, decode, received

    def sensor(self) -> None: ...

    def feed(self, name: str, stamp_ns: int, payload: Any) -> None:
        self.fed.append((name, stamp_ns, payload))

    def read(self, _topic: str, decode: Callable[..., Any], *messages: Any) -> Any:
        return decode(*messages)

    def read_aside(self, _topic: str, decode: Callable[..., Any], message: Any) -> Any:
        return decode(message)

    def create_publisher(self, *_: Any) -> Any:
        return SimpleNamespace(
            publish=self.published.append,
            wait_for_all_acked=lambda _timeout: self.acknowledged.append(len(self.published)),
        )


def match(message: Any, **more: Any) -> Match:
    return Match(5, {"detections": message, "labels": {}, **more})


def read(inputs: DetectionsIn, message: Any, **more: Any) -> Detections:
    return inputs.read(match(message, **more), (60, 80), (60, 80))


def names(inputs: DetectionsIn, message: Any) -> to_msg.Labels:
    return inputs.names(match(message), read(inputs, message))


def masks() -> Image:
    numbers = np.zeros((60, 80), np.uint8)
    numbers[10:20, 30:50] = 4
    return Image(
        header=to_msg.header(5, "camera"), height=60, width=80, step=80, encoding="mono8", data=numbers.tobytes()
    )


def boxes(count: int) -> Detections:
    xyxy = np.array([[10, 10, 20, 20]], np.float32).repeat(count, axis=0)
    return Detections(
        xyxy=xyxy, score=np.ones(count, np.float32), label=("cup",) * count, image_hw=(60, 80), stamp_ns=5
    )


def test_our_table_is_read_with_the_names_that_were_announced() -> None:
    node = NodeBase()
    inputs = DetectionsIn(node, "table")  # type: ignore[arg-type]
    node.received["labels"](to_msg.labels(NAMES))
    message = to_msg.detections_table(boxes(2), NAMES)
    node.receive("detections_table", message)
    assert node.fed == [("labels", 0, NAMES), ("detections", 5, message)]
    found, matched = read(inputs, message, labels=NAMES), match(message, labels=NAMES)
    assert found.label == ("cup", "cup") and found.instances is None and inputs.names(matched, found) == NAMES
    assert node.published == []


def test_masks_of_our_table_reach_the_segmenter_as_a_message_and_as_detections() -> None:
    instances = np.zeros((60, 80), np.uint16)
    instances[12:18, 11:15] = 1
    detections = replace(boxes(1), instances=instances)
    for stated in (detections, to_msg.detections_table(detections, NAMES)):
        seen = read(DetectionsIn(NodeBase(), "table"), stated, labels=NAMES)  # type: ignore[arg-type]
        np.testing.assert_array_equal(seen.instances, instances)


def test_a_surplus_picture_is_fed_as_one() -> None:
    node = NodeBase()
    DetectionsIn(node, "table")  # type: ignore[arg-type]
    node.receive("detections_table", to_msg.surplus(5, "camera"))
    assert node.fed == [("detections", 5, Drop.SURPLUS)]


def test_masks_bring_a_table_of_names_that_is_everywhere_before_their_objects() -> None:
    node = NodeBase()
    inputs = DetectionsIn(node, "masks")  # type: ignore[arg-type]
    node.receive("masks", masks())
    assert [name for name, *_ in node.fed] == ["labels", "detections"]
    found = read(inputs, masks())
    assert found.label == (UNNAMED,) and found.instances is not None
    assert np.bincount(found.instances.ravel())[1:].tolist() == [200]
    assert inputs.names(match(masks()), found) == {}
    assert [from_msg.labels(message) for message in node.published] == [{}] and node.acknowledged == [1]
    inputs._names = {4: "cup"}
    for _ in range(2):
        assert names(inputs, masks()) == {0: "cup"}
    assert [from_msg.labels(message) for message in node.published] == [{}, {0: "cup"}] and node.acknowledged == [1, 2]


def test_a_table_that_another_sends_meanwhile_is_sent_again_with_the_names_that_were_met() -> None:
    node = NodeBase()
    inputs = DetectionsIn(node, "auto")  # type: ignore[arg-type]
    inputs._names = {4: "sofa"}
    assert names(inputs, masks()) == {0: "sofa"}
    node.received["labels"](to_msg.labels(NAMES))  # our own detector was started beside
    assert names(inputs, masks()) == {**NAMES, 2: "sofa"}
    assert from_msg.labels(node.published[-1]) == {**NAMES, 2: "sofa"} and len(node.published) == 2
    node.received["labels"](node.published[-1])  # its own message
    names(inputs, masks())
    assert len(node.published) == 2


def test_boxes_without_vision_msgs_are_refused_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(detections_in.SOURCES, "vision_msgs", {"detections_in": None})
    with pytest.raises(ValueError, match="install ros-jazzy-vision-msgs"):
        DetectionsIn(NodeBase(), "vision_msgs")  # type: ignore[arg-type]


def test_a_picture_that_is_no_mask_is_not_taken() -> None:
    node = NodeBase()
    DetectionsIn(node, "masks")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="expected an encoding of mono8"):
        node.decode("masks", Image(height=1, width=1, step=3, encoding="rgb8", data=b"abc"))


def test_names_that_a_foreign_detector_takes_back_are_gone() -> None:
    inputs = DetectionsIn(NodeBase(), "auto")  # type: ignore[arg-type]
    inputs._on_names(SimpleNamespace(class_map=[SimpleNamespace(class_id=4, class_name="cup")]))
    assert read(inputs, masks()).label == ("cup",)
    inputs._on_names(SimpleNamespace(class_map=[]))
    assert read(inputs, masks()).label == (UNNAMED,)
