# SPDX-License-Identifier: Apache-2.0
"""Messages that once ended a node or locked an input for good. Each is counted, and the next good one passes."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CompressedImage, Image, PointCloud2
from std_msgs.msg import Header, String

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.messages.layout import OBJECTS
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.drawn_place import drawn

from .graph import Graph
from .moments import CAMERA, SECOND
from .test_malformed import changed, cloud, depths, image, table

pytestmark = pytest.mark.ros

STEP = SECOND // 10
NAMES = {0: "cup", 1: "book"}


@pytest.fixture(scope="module")
def running(graph: Graph, tiny_model: Path) -> Graph:
    """The four nodes, each in a namespace of its own."""
    graph.start(
        "/eye/detector", "detector", "-r __ns:=/eye", f"-p model:={tiny_model}", "-p reliable:=true", "-p max_rate:=0.0"
    )
    graph.start("/cut/segmenter", "segmenter", "-r __ns:=/cut", "-p reliable:=true")
    graph.start("/lay/registrar", "registrar", "-r __ns:=/lay", "-p reliable:=true")
    graph.start("/map/mapper", "mapper", "-r __ns:=/map", "-p reliable:=true")
    for namespace in ("eye", "cut", "lay", "map"):
        graph.receive(Header, f"{namespace}/finished")
    return graph


@pytest.fixture
def stamp_ns(counter: list[int] = [SECOND]) -> int:  # noqa: B006  one clock for the module
    counter[0] += 10 * STEP
    return counter[0]


def compressed(stamp_ns: int, data: bytes) -> CompressedImage:
    return CompressedImage(header=to_msg.header(stamp_ns, "eye"), format="png", data=data)


def bomb(side: int) -> bytes:
    """A PNG of side² pixels, and of next to no bytes."""
    rows = zlib.compress(bytes(side // 8 + 1) * side, 9)
    parts = ((b"IHDR", struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)), (b"IDAT", rows), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    )


def test_junk_that_comes_first_does_not_lock_the_input_of_the_detector(running: Graph, stamp_ns: int) -> None:
    running.publish("eye/image/compressed", compressed(stamp_ns, b"no picture"))
    assert running.answer("detector", stamp_ns, "eye/finished") == "dropped malformed_image"
    running.publish("eye/image/compressed", compressed(stamp_ns + STEP, bomb(30_000)))
    assert running.answer("detector", stamp_ns + STEP, "eye/finished") == "dropped malformed_image"
    for k in range(2, 14):
        running.publish("eye/image", image(stamp_ns + k * STEP))
        assert running.answer("detector", stamp_ns + k * STEP, "eye/finished") == "published"
    assert running.balance("/eye/detector", received=14).dropped == {"malformed_image": 2}


def test_the_input_changes_where_the_one_that_was_taken_is_silent_and_another_speaks(
    running: Graph, stamp_ns: int
) -> None:
    running.wait_for(lambda: "/eye/image/compressed" not in running.connected["/eye/detector"], what="one input")
    running.wait_for(lambda: "/eye/image/compressed" in running.connected["/eye/detector"], what="the other, reopened")
    running.publish("eye/image/compressed", compressed(stamp_ns, bomb(64)))
    assert running.answer("detector", stamp_ns, "eye/finished") == "published"
    running.wait_for(lambda: "/eye/image" not in running.connected["/eye/detector"], what="one input")


def depth(stamp_ns: int) -> Image:
    return Image(
        header=to_msg.header(stamp_ns, "eye"), height=240, width=320, encoding="32FC1", step=1280,
        data=to_msg._bytes(depths()),
    )  # fmt: skip


def retyped(message: PointCloud2, name: str, **changes: int) -> PointCloud2:
    """A table of which one field says that it is of another kind."""
    field = next(field for field in message.fields if field.name == name)
    for key, value in changes.items():
        setattr(field, key, value)
    return message


def of_infinite_height(stamp_ns: int) -> PointCloud2:
    message = retyped(table(stamp_ns), "image_height", datatype=7)
    message.data[22:26] = to_msg._bytes(np.full(1, np.inf, np.float32))
    message.fields[-1].offset, message.fields[-2].offset = 22, 20
    return message


def test_an_empty_cloud_that_comes_first_does_not_lock_the_input_of_the_segmenter(
    running: Graph, stamp_ns: int
) -> None:
    running.publish("cut/labels", to_msg.labels(NAMES))
    running.publish("cut/points", changed(cloud(stamp_ns), height=0, width=0, data=b""))
    assert running.answer("segmenter", stamp_ns, "cut/finished") == "dropped malformed_points"
    running.publish("cut/camera_info", to_msg.camera_info(CAMERA, stamp_ns, "eye"))
    answers = []
    for k in (1, 2):
        running.publish("cut/depth/image", depth(stamp_ns + k * STEP))
        running.publish("cut/detections_table", table(stamp_ns + k * STEP))
        answers.append(running.answer("segmenter", stamp_ns + k * STEP, "cut/finished"))
    assert answers == ["published"] * 2, running.log("/cut/segmenter")


@pytest.mark.parametrize("case", ["two counts", "infinite height", "labels beyond 16 bits"])
def test_no_table_and_no_labels_end_the_segmenter(running: Graph, stamp_ns: int, case: str) -> None:
    if case == "labels beyond 16 bits":
        running.publish("cut/labels", String(data='{"70000": "cup", "0": "cup"}'))
        bad, expected = table(stamp_ns), "published"  # by the labels before
    else:
        bad = retyped(table(stamp_ns), "class_id", count=2) if case == "two counts" else of_infinite_height(stamp_ns)
        expected = "dropped malformed_detections"
    for stamp, message, answer in ((stamp_ns, bad, expected), (stamp_ns + STEP, table(stamp_ns + STEP), "published")):
        running.publish("cut/depth/image", depth(stamp))
        running.publish("cut/detections_table", message)
        assert running.answer("segmenter", stamp, "cut/finished") == answer, running.log("/cut/segmenter")


def test_no_camera_info_takes_the_memory_of_the_segmenter(running: Graph, stamp_ns: int) -> None:
    for k, side in enumerate((20_000, 1_000_000)):
        huge = Intrinsics(fx=500.0, fy=500.0, cx=9.0, cy=9.0, width=20_000, height=20_000)
        info = changed(to_msg.camera_info(huge, stamp_ns, "eye"), width=side, height=side)
        running.publish("cut/camera_info", info)
        running.publish("cut/depth/image", depth(stamp_ns + k * STEP))
        running.publish("cut/detections_table", table(stamp_ns + k * STEP))
        assert running.answer("segmenter", stamp_ns + k * STEP, "cut/finished") == "dropped malformed_depth"
    assert running.alive("/cut/segmenter")


def lay(graph: Graph, frame: Frame, objects: PointCloud2 | None = None) -> str:
    """Send a frame to the registrar; what became of it."""
    graph.publish("lay/labels", to_msg.labels(NAMES))
    graph.publish("lay/view", to_msg.view(frame))
    graph.publish("lay/view/camera_info", to_msg.view_camera_info(frame))
    graph.publish("lay/gravity", to_msg.gravity(frame))
    graph.publish("lay/objects", to_msg.objects(frame, NAMES) if objects is None else objects)
    return graph.answer("registrar", frame.stamp_ns, "lay/finished")


@pytest.mark.parametrize(("field", "value"), [("x", 3e38), ("normal_x", 1e30), ("x", 1e5), ("density", np.nan)])
def test_no_number_of_an_object_ends_the_registrar(running: Graph, stamp_ns: int, field: str, value: float) -> None:
    frame = drawn(stamp_ns)
    message = to_msg.objects(frame, NAMES)
    rows = np.frombuffer(bytes(message.data), OBJECTS).copy()
    rows[field][::3] = value
    message.data = to_msg._bytes(rows)
    assert lay(running, frame, message) == "dropped malformed_frame"
    assert lay(running, drawn(stamp_ns + STEP)) == "published"
    assert running.alive("/lay/registrar")


def constraint(stamp_ns: int, child: str) -> Odometry:
    message = Odometry(header=to_msg.header(stamp_ns, "camera@1.000000000"), child_frame_id=child)
    message.pose.pose.orientation.w = 1.0
    message.pose.covariance = np.eye(6).ravel()
    return message


@pytest.mark.parametrize(
    "child", ["camera@" + "9" * 4000 + ".000000000", "camera@2147483648.000000001", "camera@-9999999999.000000000", ""]
)
def test_no_name_of_a_moment_ends_the_mapper(running: Graph, stamp_ns: int, child: str) -> None:
    running.publish("map/constraints", constraint(stamp_ns, child))
    assert running.answer("mapper", stamp_ns, "map/finished") == "dropped malformed_constraints"
    assert running.alive("/map/mapper")


def test_a_stamp_beside_all_time_is_counted_and_passed_over(running: Graph, stamp_ns: int) -> None:
    odd = compressed(stamp_ns, bomb(64))
    odd.header.stamp.nanosec = 4_000_000_000
    running.publish("eye/image/compressed", odd)
    running.publish("eye/image/compressed", compressed(stamp_ns + STEP, bomb(64)))
    assert running.answer("detector", stamp_ns + STEP, "eye/finished") == "published"
    assert "image/compressed ignored: stamp: expected nanoseconds below" in running.log("/eye/detector")


def test_every_node_is_still_there(running: Graph) -> None:
    for name in running.processes:
        assert running.alive(name) and "Traceback" not in running.log(name), running.log(name)
