# SPDX-License-Identifier: Apache-2.0
"""Two robots with a keyframer each, one registrar and one mapper for both: live, in processes of their own."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry as OdometryMsg
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from objreg_ros.bridge.messages import from_msg, to_msg
from objreg_ros.bridge.messages.keyframes_msg import read_keyframe
from objreg_ros.bridge.node import qos
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.geometry import inverse, pose, pose_error
from objreg_ros.memory.store import Store

from .graph import START_S, Graph
from .test_relocalised import BESIDE, HERE, frame

pytestmark = pytest.mark.ros

SECOND = 1_000_000_000
MOUNT = "-p T_base_camera:=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]"
BEHIND = pose(np.eye(3), np.array([0.05, 0.1, 0.0]))  # a step aside
SEEN = {"r1": (HERE, HERE @ BEHIND), "r2": (BESIDE, BESIDE @ BEHIND)}


RMWS = "rmw_fastrtps_cpp", "rmw_cyclonedds_cpp", "rmw_zenoh_cpp"
SAID = """
import rclpy
from rclpy.utilities import get_rmw_implementation_identifier
from objreg_ros.keyframes.node import KeyframerNode
rclpy.init()
node = KeyframerNode()
topics = [publisher.topic_name for publisher in node.publishers]
print(get_rmw_implementation_identifier(), *(topic for topic in topics if topic.endswith("keyframes")))
node.close()
"""


@pytest.fixture
def fleet(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def send_frame(graph: Graph, robot: str, seen: Frame, names: dict[int, str]) -> None:
    """What a segmenter in the robot's namespace says of a frame, to who follows it and to registrar or mapper."""
    assert seen.T_odom_camera is not None
    odometry = Odometry(T_odom_body=seen.T_odom_camera, stamp_ns=seen.stamp_ns, child_frame_id=seen.frame_id)
    graph.publish(f"{robot}/labels", to_msg.labels(names))
    graph.publish(f"{robot}/odom", to_msg.odometry(replace(odometry, frame_id=f"{robot}/odom")), listeners=2)
    for topic, message in {
        "objects": to_msg.objects(seen, names),
        "view": to_msg.view(seen),
        "view/camera_info": to_msg.view_camera_info(seen),
        "gravity": to_msg.gravity(seen),
    }.items():
        graph.publish(f"{robot}/{topic}", message)


def drive(graph: Graph, robot: str, begin_s: int, node: str = "keyframer", sent: int = 4) -> None:
    """Frames at two places in turn, far enough apart for a keyframe each; all but the last make one."""
    names = {0: "cup"}
    for k in range(5):
        T = SEEN[robot][k % 2]
        seen = frame(begin_s + 2 * k, T, T)
        names = names | dict(enumerate(sorted({cloud.label for cloud in seen.objects})))
        send_frame(graph, robot, seen, names)
        graph.answer(node, seen.stamp_ns, f"{robot}/finished")
    graph.wait_for(lambda: len(graph.received[f"{robot}/keyframes"]) == sent, what=f"keyframes of {robot}")


def place(robot: str, since_ns: int) -> Array:
    """Where a robot was so long after its first frame."""
    return SEEN[robot][since_ns // SECOND // 2 % 2]


def test_keyframes_of_two_robots_close_loops_in_one_registrar_and_tie_them_in_one_map(
    fleet: Graph, tmp_path: Path
) -> None:
    store = tmp_path / "fleet.db"
    for topic in ("r1/finished", "r2/finished", "finished"):
        fleet.receive(Header, topic)
    for robot in SEEN:
        fleet.receive(CompressedImage, f"{robot}/keyframes", qos.latched(qos.KEPT_KEYFRAMES))
        fleet.receive(TransformStamped, f"{robot}/correction", qos.latched())
        fleet.start(f"{robot}/keyframer", "keyframes", f"-r __ns:=/{robot}", "-p reliable:=true", MOUNT)
    fleet.receive(OdometryMsg, "constraints", qos.latched(qos.KEPT_CONSTRAINTS))
    fleet.receive(DiagnosticArray, "refusals", qos.stage(depth=100))
    fleet.start("registrar", "registrar", "-p robots:=[r1, r2]", f"-p store:={store}")
    fleet.start("mapper", "mapper", "-p robots:=[r1, r2]", "-p publish_tf:=false", MOUNT)
    drive(fleet, "r1", 100)
    drive(fleet, "r2", 101)  # at the same time, by the same clock
    keyframes = {robot: [read_keyframe(m) for m in fleet.received[f"{robot}/keyframes"]] for robot in SEEN}
    assert all(max(len(s.packed) for s in sent) < 100_000 for sent in keyframes.values())
    for sent in (s for of in keyframes.values() for s in of):
        assert fleet.answer("registrar", sent.stamp_ns) == "published"
    closures = [from_msg.loop_closure(message) for message in fleet.received["constraints"]]
    between = [c for c in closures if (c.from_frame_id, c.to_frame_id) == ("r1/camera", "r2/camera")]
    assert between
    for closure in between:
        there, here = place("r1", closure.from_ns - 100 * SECOND), place("r2", closure.to_ns - 101 * SECOND)
        degrees, centimetres = pose_error(closure.T_from_to, inverse(there) @ here)
        assert degrees < 2.0 and centimetres < 3.0
    fleet.wait_for(lambda: bool(fleet.received["r2/correction"]), what="the second robot in the map")
    fleet.stop("registrar")
    stored = Store(store, read_only=True)
    assert {stored.keyframe(k).robot for k in stored.keyframe_ids()} == {"r1", "r2"}
    assert 8 <= len(stored.keyframe_ids()) <= 10  # a robot that rests for a while sends the one that it has in hand
    stored.close()


def test_a_registrar_that_starts_anew_takes_what_was_sent_meanwhile_and_nothing_twice(
    fleet: Graph, tmp_path: Path
) -> None:
    store = tmp_path / "fleet.db"
    fleet.receive(Header, "r1/finished")
    fleet.receive(Header, "finished")
    fleet.receive(CompressedImage, "r1/keyframes", qos.latched(qos.KEPT_KEYFRAMES))
    fleet.start("r1/keyframer", "keyframes", "-r __ns:=/r1", "-p reliable:=true", MOUNT)
    started = "-p robots:=[r1]", f"-p store:={store}"
    fleet.start("registrar", "registrar", *started)
    fleet.start("mapper", "mapper", "-p robots:=[r1]", "-p publish_tf:=false", MOUNT)
    drive(fleet, "r1", 100)
    stamps = [read_keyframe(message).stamp_ns for message in fleet.received["r1/keyframes"]]
    assert [fleet.answer("registrar", stamp) for stamp in stamps] == ["published"] * 4
    fleet.stop("registrar")
    fleet.counters.clear()
    fleet.start("registrar", "registrar", *started)
    fleet.wait_for(lambda: "/registrar" in fleet.counters, START_S, "the registrar")
    fleet.wait_for(
        lambda: fleet.counters["/registrar"].dropped.get("known", 0) >= 4, what="the registrar to know all four"
    )
    fleet.stop("registrar")
    stored = Store(store, read_only=True)
    assert [stored.keyframe(k).stamp_ns for k in stored.keyframe_ids()][:4] == stamps  # the last comes once it rests
    stored.close()


@pytest.mark.parametrize("is_signed", [False, True])
def test_two_registrars_that_each_keep_a_store_close_loops_between_their_robots(
    fleet: Graph, tmp_path: Path, is_signed: bool
) -> None:
    (tmp_path / "key").write_text("a key of the whole fleet")
    key = [f"-p key_file:={tmp_path / 'key'}"] if is_signed else []
    for robot in SEEN:
        fleet.receive(Header, f"{robot}/finished")
        fleet.receive(OdometryMsg, f"{robot}/constraints", qos.latched(qos.KEPT_CONSTRAINTS))
        own = "-p exchange:=/fleet", f"-p store:={tmp_path / robot}.db", "-p reliable:=true", MOUNT, *key
        fleet.start(f"/{robot}/registrar", "registrar", f"-r __ns:=/{robot}", *own)
    fleet.start("mapper", "mapper", "-p robots:=[r1, r2]", "-p publish_tf:=false", MOUNT)
    drive(fleet, "r1", 100, "registrar", 0)
    drive(fleet, "r2", 101, "registrar", 0)

    def between() -> list[LoopClosure]:
        constraints = [from_msg.loop_closure(m) for robot in SEEN for m in fleet.received[f"{robot}/constraints"]]
        return [one for one in constraints if one.from_frame_id.split("/")[0] != one.to_frame_id.split("/")[0]]

    fleet.wait_for(lambda: bool(between()), what="a closure between the robots")
    for closure in between():
        ends = (closure.from_frame_id, closure.from_ns), (closure.to_frame_id, closure.to_ns)
        there, here = (place(camera[:2], ns - (100 if camera[:2] == "r1" else 101) * SECOND) for camera, ns in ends)
        degrees, centimetres = pose_error(closure.T_from_to, inverse(there) @ here)
        assert degrees < 2.0 and centimetres < 3.0
    for robot in SEEN:
        stored = Store(tmp_path / f"{robot}.db", read_only=True)
        assert {stored.keyframe(k).robot for k in stored.keyframe_ids()} == {robot}
        stored.close()


@pytest.mark.parametrize("rmw", RMWS)
def test_a_keyframer_publishes_under_any_rmw_that_is_installed(fleet: Graph, rmw: str) -> None:
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    if importlib.util.find_spec(rmw) is None and not any((Path(p) / "share" / rmw).is_dir() for p in prefixes if p):
        pytest.skip(f"{rmw} is not installed")
    environment = {**fleet.environment(), "RMW_IMPLEMENTATION": rmw}
    said = subprocess.run(
        [sys.executable, "-c", SAID], env=environment, capture_output=True, text=True, timeout=START_S
    )
    assert said.returncode == 0, said.stderr
    assert said.stdout.split()[-2:] == [rmw, "/keyframes"]
