# SPDX-License-Identifier: Apache-2.0
"""A segmenter that receives an IMU."""

from __future__ import annotations

import numpy as np
import pytest
from geometry_msgs.msg import Vector3Stamped
from sensor_msgs.msg import Image, Imu, PointCloud2
from std_msgs.msg import Header

from objreg_ros.bridge.messages import to_msg
from objreg_ros.data.checked import Array
from objreg_ros.data.images import Detections
from objreg_ros.sensor import gravity_sigma_deg

from .graph import Graph
from .moments import CAMERA, SECOND

pytestmark = pytest.mark.ros

NAMES = {0: "cup"}
HZ = 100


@pytest.fixture(scope="module")
def running(graph: Graph) -> Graph:
    """A segmenter of depth images whose camera has an IMU with x ahead and z up."""
    mounting = "T_camera_imu:=[0.0,0.0,0.0,0.5,-0.5,0.5,0.5]"
    graph.start("/segmenter", "segmenter", "-p reliable:=true", "-p colour:=false", f"-p {mounting}")
    graph.receive(Vector3Stamped, "gravity")
    graph.receive(Header, "finished")
    graph.publish("labels", to_msg.labels(NAMES))
    graph.publish("camera_info", to_msg.camera_info(CAMERA, SECOND, "eye"))
    return graph


def imu(stamp_ns: int, acceleration: tuple[float, float, float]) -> Imu:
    message = Imu(header=to_msg.header(stamp_ns, "imu"))
    force, turn = message.linear_acceleration, message.angular_velocity
    force.x, force.y, force.z = acceleration
    turn.x, turn.y, turn.z = 0.0, 1e-6, 0.0
    message.orientation_covariance[0] = -1.0
    return message


def see(graph: Graph, stamp_ns: int) -> str:
    """A bare wall with a box of a cup in it."""
    box = np.array([[100, 70, 220, 170]], np.float32)
    seen = Detections(xyxy=box, score=np.ones(1, np.float32), label=("cup",), image_hw=(240, 320), stamp_ns=stamp_ns)
    depth = np.full((240, 320), 1.5, np.float32)
    picture = Image(
        header=to_msg.header(stamp_ns, "eye"), height=240, width=320, encoding="32FC1", step=1280,
        data=depth.tobytes(),
    )  # fmt: skip
    table: PointCloud2 = to_msg.detections_table(seen, NAMES)
    graph.publish("depth/image", picture)
    graph.publish("detections_table", table)
    return graph.answer("segmenter", stamp_ns)


def gravity_of(graph: Graph, count: int) -> Array:
    """The gravity of the newest of so many frames."""
    graph.wait_for(lambda: len(graph.received["gravity"]) == count, what="gravity")
    vector = graph.received["gravity"][-1].vector
    return np.array([vector.x, vector.y, vector.z])


def test_a_segmenter_gives_the_gravity_that_an_imu_feels_whatever_else_the_imu_says(running: Graph) -> None:
    tilt = np.radians(20.0)
    felt = (9.81 * np.sin(tilt), 0.0, 9.81 * np.cos(tilt))  # the camera looks up by 20 degrees
    start = 10 * SECOND
    assert see(running, start - SECOND) == "published"  # from here on it is known where depth comes from
    for k in range(2 * HZ):
        stamp_ns = start + k * SECOND // HZ
        hostile = {50: (np.nan, 0.0, 0.0), 60: (0.0, 0.0, 0.0), 70: (1e30, 0.0, 0.0)}.get(k)
        running.publish("imu", imu(stamp_ns, hostile or felt))
        if k == 80:
            running.publish("imu", imu(start, (0.0, 0.0, -9.81)))  # late
    for later in range(9):  # a busy machine may read the IMU after the first picture
        assert see(running, start + SECOND + later * SECOND // 10) == "published"
        falls = gravity_of(running, 2 + later)
        confidence = float(np.linalg.norm(falls))
        if confidence > 0:
            break
    assert falls / confidence == pytest.approx([0.0, np.cos(tilt), -np.sin(tilt)], abs=1e-3)
    assert gravity_sigma_deg(confidence) < 2.5

    def values() -> dict[str, str]:
        return {pair.key: pair.value for pair in running.status["/segmenter"].values}

    running.wait_for(lambda: values().get("gravity from imu") == "1", what="diagnostics of gravity")
    assert values()["depth noise (a Kinect v1 has 1)"] == "0.00"  # a wall without any
    expected = {"malformed imu": "1", "imu no_acceleration": "1", "imu norm": "1", "imu late": "1"}
    assert {key: values().get(key) for key in expected} == expected
    assert running.alive("/segmenter")
