# SPDX-License-Identifier: Apache-2.0
"""Boxes without a definition are read as newer versions of vision_msgs have them, and older bytes are not misread."""

from __future__ import annotations

import dataclasses
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from objreg_tools.recording import open_recording
from objreg_tools.recording.recorded_detections import choose_detections
from objreg_tools.recording.rosbag.vision_types import DEFINITIONS, PACKAGE, define_vision

BOXES = f"{PACKAGE}Detection2DArray"
GALACTIC = {**DEFINITIONS, "BoundingBox2D": "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y"}
FOXY = {
    **GALACTIC,
    "ObjectHypothesisWithPose": "string id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose",
    "Detection2D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox2D bbox\nsensor_msgs/Image source_img\nbool is_tracking\nstring tracking_id",
}


def defined(definitions: dict[str, str]) -> Typestore:
    types = get_typestore(Stores.ROS2_FOXY)
    for name, text in definitions.items():
        types.register(get_types_from_msg(text, f"{PACKAGE}{name}"))
    return types


def filled(types: Typestore, kind: str, number: float = 1.0) -> Any:
    """A message with a number in each field, and one item in each list of messages."""
    made: Any = types.types[kind]
    values = {}
    for name, (node, of) in types.fielddefs[kind][1]:
        values[name] = value_of(types, int(node), of, number)
    assert {field.name for field in dataclasses.fields(made) if field.init} >= set(values)
    return made(**values)


def value_of(types: Typestore, node: int, of: Any, number: float) -> Any:
    """Of a plain field (1), of a message (2), or of a list."""
    if node == 1:
        plain = {"string": "1", "bool": True, "float64": number}
        return plain.get(of[0], 1)
    if node == 2:
        return filled(types, of, number)
    inner, length = of
    if int(inner[0]) == 2:
        return [filled(types, inner[1], number)]
    return np.full(length or 3, 1, np.dtype(inner[1][0]))


def assumed() -> Typestore:
    types = get_typestore(Stores.ROS2_JAZZY)
    assert define_vision(types, [BOXES, "std_msgs/msg/Header"]) == [BOXES]
    return types


def test_boxes_of_versions_3_and_4_have_the_same_bytes() -> None:
    galactic = defined(GALACTIC)
    read: Any = assumed().deserialize_cdr(galactic.serialize_cdr(filled(galactic, BOXES), BOXES), BOXES)
    (one,) = read.detections
    assert (one.bbox.center.position.x, one.bbox.center.theta, one.bbox.size_y, one.id) == (1.0, 1.0, 1.0, "1")
    assert (one.results[0].hypothesis.class_id, one.results[0].hypothesis.score) == ("1", 1.0)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_boxes_of_version_2_are_refused_and_not_misread(count: int, tmp_path: Path) -> None:
    foxy = defined(FOXY)
    message = filled(foxy, BOXES)
    message.detections = message.detections * count
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/boxes", BOXES, typestore=foxy)
        writer.write(connection, 5, foxy.serialize_cdr(message, BOXES))
    with sqlite3.connect(next((tmp_path / "bag").glob("*.db3"))) as storage:
        storage.execute("DELETE FROM message_definitions")
    with open_recording(tmp_path / "bag") as recording, pytest.raises(ValueError, match="/boxes"):
        choose_detections(recording, "/boxes")


def test_what_is_defined_stays() -> None:
    foxy = defined(FOXY)
    before = foxy.fielddefs[BOXES]
    assert define_vision(foxy, [BOXES, f"{PACKAGE}LabelInfo"]) == [] and foxy.fielddefs[BOXES] is before


def test_nothing_is_added_for_a_bag_that_does_not_use_it() -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    assert define_vision(types, ["std_msgs/msg/Header"]) == [] and BOXES not in types.fielddefs
