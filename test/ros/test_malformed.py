# SPDX-License-Identifier: Apache-2.0
"""Messages that no node may trust: each is dropped with its reason, said in the log, and the next good one passes."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header

from objreg_ros.bridge.messages import to_msg
from objreg_ros.data.images import Detections, PointCloud
from objreg_ros.geometry import back_project

from .graph import Graph
from .moments import CAMERA, SECOND

pytestmark = pytest.mark.ros

STEP = SECOND // 10
NAMES = {0: "cup"}


@pytest.fixture(scope="module")
def running(graph: Graph, tiny_model: Path) -> Graph:
    """A detector, a segmenter of clouds, and one of depth images with a level odometry."""
    graph.start("/detector", "detector", f"-p model:={tiny_model}", "-p reliable:=true")
    graph.start("/clouds/segmenter", "segmenter", "-r __ns:=/clouds", "-p reliable:=true")
    of_depths = ("-r __ns:=/depths", "-p reliable:=true", "-p colour:=false", "-p level_odom:=true")
    graph.start("/depths/segmenter", "segmenter", *of_depths)
    graph.receive(Vector3Stamped, "depths/gravity")
    for topic in ("finished", "clouds/finished", "depths/finished"):
        graph.receive(Header, topic)
    return graph


@pytest.fixture
def stamp_ns(counter: list[int] = [SECOND]) -> int:  # noqa: B006  one clock for the module
    counter[0] += 10 * STEP
    return counter[0]


def image(stamp_ns: int) -> Image:
    """A good picture."""
    return Image(header=to_msg.header(stamp_ns, "eye"), height=6, width=8, encoding="mono8", step=8, data=bytes(48))


def table(stamp_ns: int) -> PointCloud2:
    """Detections of one cup."""
    box = np.array([[100, 70, 220, 170]], np.float32)
    one = np.ones(1, np.float32)
    seen = Detections(xyxy=box, score=one, label=("cup",), image_hw=(240, 320), stamp_ns=stamp_ns)
    return to_msg.detections_table(seen, NAMES)


def depths() -> np.ndarray:
    depth = np.full((CAMERA.height, CAMERA.width), 1.2, np.float32)
    depth[90:150, 120:200] -= 0.2
    return depth


def cloud(stamp_ns: int, xyz: np.ndarray | None = None) -> PointCloud2:
    """A good cloud."""
    points = back_project(depths(), CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy) if xyz is None else xyz
    return to_msg.points(PointCloud(xyz=points.astype(np.float32), rgb=None, stamp_ns=stamp_ns, frame_id="eye"))


def changed(message: Any, **values: Any) -> Any:
    for name, value in values.items():
        setattr(message, name, value)
    return message


def without_z(stamp_ns: int) -> PointCloud2:
    message = cloud(stamp_ns)
    message.fields = message.fields[:2]
    return message


IMAGES: dict[str, tuple[Callable[[int], Image], str]] = {
    "an unknown encoding": (lambda t: changed(image(t), encoding="yuv9"), "got 'yuv9'"),
    "an empty image": (lambda t: changed(image(t), height=0, width=0, step=0, data=b""), "expected pixels, got 0 × 0"),
    "a truncated image": (lambda t: changed(image(t), data=bytes(40)), "expected 48 bytes for 8 × 6, got 40"),
}

CLOUDS: dict[str, tuple[Callable[[int], PointCloud2], str, str]] = {
    "a truncated cloud": (lambda t: changed(cloud(t), data=bytes(1000)), "malformed_points", "got 1000; truncated?"),
    "a missing field": (without_z, "malformed_points", "expected the fields x, y, z"),
    "an empty cloud": (
        lambda t: changed(cloud(t), height=0, width=0),
        "malformed_points",
        "expected points, got 0 × 0",
    ),
    "a NaN-only cloud": (lambda t: cloud(t, np.full((240, 320, 3), np.nan)), "refused", "cloud"),
    "a 1 × N cloud without a camera": (lambda t: cloud(t, np.ones((1, 500, 3))), "refused", "camera_info"),
}


@pytest.mark.parametrize("case", IMAGES)
def test_the_detector_drops_a_bad_image_and_goes_on(running: Graph, stamp_ns: int, case: str) -> None:
    make, text = IMAGES[case]
    running.publish("image", make(stamp_ns))
    assert running.answer("detector", stamp_ns) == "dropped malformed_image"
    running.publish("image", image(stamp_ns + STEP))
    assert running.answer("detector", stamp_ns + STEP) == "published"
    if case == "an unknown encoding":  # the first of its reason; the others are throttled
        assert text in running.log("/detector")


@pytest.mark.parametrize("case", CLOUDS)
def test_the_segmenter_drops_a_bad_cloud_and_goes_on(running: Graph, stamp_ns: int, case: str) -> None:
    make, reason, _ = CLOUDS[case]
    running.publish("clouds/labels", to_msg.labels(NAMES))
    for message, stamp, expected in (
        (make(stamp_ns), stamp_ns, f"dropped {reason}"),
        (cloud(stamp_ns + STEP), stamp_ns + STEP, "published"),
    ):
        running.publish("clouds/points", message)
        running.publish("clouds/detections_table", table(stamp))
        assert running.answer("segmenter", stamp, "clouds/finished") == expected, running.log("/clouds/segmenter")


def test_a_segmenter_of_clouds_takes_no_pictures(running: Graph) -> None:
    assert running.node.count_subscribers("/depths/image") == 0  # not asked for colour
    assert running.node.count_subscribers("/clouds/image") == 0  # the cloud that spoke brings its own


def test_the_log_says_what_was_expected_and_what_came(running: Graph) -> None:
    log = running.log("/clouds/segmenter")
    assert "frame dropped, malformed points: " in log and "frame dropped, refused: " in log
    assert CLOUDS["a truncated cloud"][2] in log


def test_the_segmenter_drops_bad_depth_and_detections_passes_over_bad_odometry_and_goes_on(
    running: Graph, stamp_ns: int
) -> None:
    def depth(stamp: int) -> Image:
        return Image(
            header=to_msg.header(stamp, "eye"), height=240, width=320, encoding="32FC1", step=1280,
            data=to_msg._bytes(depths()),
        )  # fmt: skip

    def odometry(stamp: int, w: float) -> Odometry:
        message = Odometry(header=to_msg.header(stamp, "odom"))
        message.pose.pose.orientation.w = w
        return message

    running.publish("depths/labels", to_msg.labels(NAMES))
    running.publish("depths/camera_info", to_msg.camera_info(CAMERA, stamp_ns, "eye"))
    times = [stamp_ns + k * STEP for k in range(4)]
    cases = (
        (changed(depth(times[0]), encoding="bgr8"), table(times[0]), 1.0, "dropped malformed_depth"),
        (depth(times[1]), changed(table(times[1]), data=b"", width=1), 1.0, "dropped malformed_detections"),
        (depth(times[2]), table(times[2]), 0.0, "published"),
        (depth(times[3]), table(times[3]), 1.0, "published"),
    )
    for stamp, (picture, detections, w, expected) in zip(times, cases, strict=True):
        running.publish("depths/odom", odometry(stamp, w))
        running.publish("depths/odom", odometry(stamp + STEP // 2, 1.0))  # else a frame waits for what may still come
        running.publish("depths/depth/image", picture)
        running.publish("depths/detections_table", detections)
        assert running.answer("segmenter", stamp, "depths/finished") == expected
    running.wait_for(lambda: bool(running.received["depths/gravity"]), what="gravity")
    falls = running.received["depths/gravity"][-1].vector
    assert (falls.x, falls.y, falls.z) == (0.0, 0.0, -1.0)
    assert "odom ignored: " in running.log("/depths/segmenter")


def test_depth_without_detections_is_dropped_as_unmatched_once_newer_ones_came(running: Graph, stamp_ns: int) -> None:
    running.publish("clouds/points", cloud(stamp_ns))
    running.publish("clouds/points", cloud(stamp_ns + STEP))
    running.publish("clouds/detections_table", table(stamp_ns + STEP))
    assert running.answer("segmenter", stamp_ns, "clouds/finished") == "dropped unmatched"
    assert running.answer("segmenter", stamp_ns + STEP, "clouds/finished") == "published"


def test_every_node_is_still_there_and_its_counters_balance(running: Graph) -> None:
    for name in running.processes:
        assert running.alive(name), running.log(name)
    counters = running.balance("/detector", received=2 * len(IMAGES))
    assert counters.published == len(IMAGES) and counters.dropped == {"malformed_image": len(IMAGES)}
    counters = running.balance("/clouds/segmenter", received=2 * len(CLOUDS) + 2)
    assert counters.dropped == {"malformed_points": 3, "refused": 2, "unmatched": 1}


def test_a_camera_that_is_not_calibrated_stops_only_clouds_that_need_one(running: Graph, stamp_ns: int) -> None:
    info = changed(to_msg.camera_info(CAMERA, stamp_ns, "eye"), k=np.zeros(9), p=np.zeros(12))

    def answer(k: int, message: PointCloud2) -> str:
        running.publish("clouds/camera_info", info)  # as a camera does, with every cloud
        running.publish("clouds/points", message)
        running.publish("clouds/detections_table", table(stamp_ns + k * STEP))
        return running.answer("segmenter", stamp_ns + k * STEP, "clouds/finished")

    for k in range(8):
        found = answer(k, cloud(stamp_ns + k * STEP, np.ones((1, 500, 3))))
        if found != "dropped refused":  # as long as it has no camera at all
            break
        time.sleep(1.0)
    assert found == "dropped malformed_camera_info", running.log("/clouds/segmenter")
    assert answer(9, cloud(stamp_ns + 9 * STEP)) == "published"
