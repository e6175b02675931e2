# SPDX-License-Identifier: Apache-2.0
"""Someone has a detector of their own: what it found lies in the bag, or it is an ONNX file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from recording.vision import vision_types
from rosbags.rosbag2 import StoragePlugin, Writer

from objreg_ros import share
from objreg_ros.bridge.messages import from_msg, headers
from objreg_ros.data.images import Detections
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.labels import METADATA_KEY
from objreg_ros.detector.params import DetectorParams
from objreg_tools.recording import Record, open_recording
from objreg_tools.recording.rosbag import messages

from .trying import body
from .walk import Walk

BOXES = "/yolo/detections"
TOPICS = ("/image", "/depth/image", "/camera_info", "/odom", "/ground_truth")
FRAMES = 24
FEW = ("--max-frames", "3")


def recorded_detections(folder: Path, room: Path) -> None:
    """`inspect` names the option that takes them; `offline` and `report` have it."""
    _bag_with_boxes(room, folder / "bag")
    someone = Walk(folder)
    seen = someone.type("inspect", "bag")
    assert f"--detections {BOXES} runs with them" in seen.text
    forgot = someone.type("offline", "bag", *FEW)
    assert f"which are not used: --detections {BOXES} takes them" in forgot.text

    run = someone.type("offline", "bag", "--detections", BOXES, "--json", "run.json")
    made = json.loads((folder / "run.json").read_text())
    assert made["detections_from"] == BOXES and made["constraints"] and not made["truth"]["false"]
    assert someone.follow(run).text.count("wrote report.html")
    again = someone.type("offline", "bag", "--detections", BOXES)
    assert again.command() == ["report", "bag", "--detections", BOXES]
    someone.follow(again, *FEW, "--out", "again.html")
    assert f"--detections {BOXES}" in body(folder / "again.html")


def own_model(folder: Path, room: Path) -> None:
    """The refusal of a model without names says what it needs, and with it the run goes on."""
    names = _without_names(share.model(share.EMBEDDED), folder / "best.onnx")
    someone = Walk(folder)
    refused = someone.type("offline", str(room), "--model", "best.onnx", *FEW, ends=1)
    assert "labels of best.onnx: expected" in refused.text and "--labels" in refused.text
    (folder / "best.txt").write_text("\n".join(names))
    run = someone.type("offline", str(room), "--model", "best.onnx", "--max-frames", str(FRAMES))
    assert run.command() == ["report", str(room), "--model", "best.onnx", "--max-frames", str(FRAMES)]
    tried = someone.type("try", str(room), "--model", "best.onnx", "--no-open", *FEW)
    assert "best.onnx, as asked for" in tried.text


def _without_names(model: Path, copy: Path) -> list[str]:
    """Write the model without its names, as most tools export one; the names."""
    network = onnx.load(model)
    (names,) = (entry for entry in network.metadata_props if entry.key == METADATA_KEY)
    network.metadata_props.remove(names)
    onnx.save(network, copy)
    return [str(name) for name in json.loads(names.value)]


def _bag_with_boxes(room: Path, bag: Path) -> None:
    """The first frames of a room with the boxes of a detector, which come a little later than their pictures."""
    detector, types = Detector(DetectorParams(), share.model(share.EMBEDDED)), vision_types()
    records = list[Record]()
    with open_recording(room) as opened:
        wanted = [topic for topic in TOPICS if topic in opened.topics]
        stamps_ns = [headers.stamp_ns(record.message) for record in opened.records(["/image"])][:FRAMES]
        for record in opened.records(wanted, end_ns=stamps_ns[-1] + 10**6):
            records.append(Record.of(record.topic, record.message, record.stamp_ns))
            if record.topic == "/image":
                found = detector.detect(from_msg.image(record.message))
                records.append(Record.of(BOXES, _boxes(found), record.stamp_ns + 50_000_000))
    records.sort(key=lambda record: record.stamp_ns)
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = dict[str, Any]()
        for record in records:
            if record.topic not in connections:
                connections[record.topic] = writer.add_connection(record.topic, record.msgtype, typestore=types)
            data = types.serialize_cdr(record.message, record.msgtype)
            writer.write(connections[record.topic], record.stamp_ns, data)


def _boxes(found: Detections) -> Any:
    """A Detection2DArray whose class ids are names."""
    made = {name: vision_types().types[f"vision_msgs/msg/{name}"] for name in MADE}
    head = messages.header(found.stamp_ns, found.frame_id)
    pose = messages.message("geometry_msgs/PoseWithCovariance", pose=messages.pose(np.eye(4)), covariance=np.zeros(36))
    detections = []
    for (left, top, right, bottom), score, label in zip(found.xyxy.tolist(), found.score, found.label, strict=True):
        middle = made["Pose2D"](position=made["Point2D"](x=(left + right) / 2, y=(top + bottom) / 2), theta=0.0)
        guess = made["ObjectHypothesis"](class_id=label, score=float(score))
        box = made["BoundingBox2D"](center=middle, size_x=right - left, size_y=bottom - top)
        best = made["ObjectHypothesisWithPose"](hypothesis=guess, pose=pose)
        detections.append(made["Detection2D"](header=head, results=[best], bbox=box, id=""))
    return made["Detection2DArray"](header=head, detections=detections)


MADE = (
    "Pose2D",
    "Point2D",
    "ObjectHypothesis",
    "ObjectHypothesisWithPose",
    "BoundingBox2D",
    "Detection2D",
    "Detection2DArray",
)
