# SPDX-License-Identifier: Apache-2.0
"""Frames through three live nodes: whatever goes in comes out, or is dropped with a reason."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from objreg_ros.bridge.messages import from_msg, headers
from objreg_ros.bridge.messages.layout import table
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.diagnostics import refusal_of

from .graph import ANSWER_S, REPOSITORY, START_S, Graph
from .moments import Moment, drawn, recorded

pytestmark = pytest.mark.ros

SHARED = Path(os.environ.get("OBJREG_SHARED", REPOSITORY.parent / "shared"))
KITCHEN, COCO = SHARED / "data" / "redkitchen_a", SHARED / "models" / "ssd_mobilenet_v1_coco_int8.onnx"
STAGES = ("detector", "segmenter", "registrar")
WIRE = {"objects": PointCloud2, "view": PointCloud2, "view/camera_info": CameraInfo, "gravity": Vector3Stamped}


@pytest.fixture(scope="module")
def moments() -> list[Moment]:
    return recorded(KITCHEN, count=12, step=5) if KITCHEN.is_dir() and COCO.is_file() else list(drawn(12))


@pytest.fixture(scope="module")
def running(graph: Graph, tiny_model: Path) -> Graph:
    """The three nodes, loss-free."""
    model = COCO if KITCHEN.is_dir() and COCO.is_file() else tiny_model
    graph.start("/detector", "detector", f"-p model:={model}", "-p threshold:=0.4", "-p reliable:=true")
    graph.start("/segmenter", "segmenter", "-p reliable:=true")
    graph.start("/registrar", "registrar", "-p reliable:=true")
    graph.receive(Header, "finished")
    for topic, kind in WIRE.items():
        graph.receive(kind, topic)
    for topic in ("detections_table", "landmarks"):
        graph.receive(PointCloud2, topic)
    graph.receive(DiagnosticArray, "refusals")
    return graph


def connected(graph: Graph) -> bool:
    """Whether the nodes are connected to each other."""
    inner = {
        "/segmenter": ("/detections_table", "/labels"),
        "/registrar": ("/labels", *(f"/{topic}" for topic in WIRE)),
    }
    return all(graph.connected.get(node, {}).get(topic) for node, topics in inner.items() for topic in topics)


def feed(graph: Graph, moment: Moment) -> None:
    for topic, message in moment.messages.items():
        graph.publish(topic, message, listeners=2 if topic == "image" else 1)


def call(graph: Graph, kind: type, name: str, **values: object) -> tuple[bool, str]:
    client = graph.node.create_client(kind, name)
    graph.wait_for(client.service_is_ready, START_S, name)
    future = client.call_async(kind.Request(**values))
    graph.wait_for(future.done, ANSWER_S, f"the answer of {name}")
    return future.result().success, future.result().message


def test_every_frame_passes_three_nodes_and_every_node_balances_its_counters(
    running: Graph, moments: list[Moment]
) -> None:
    running.wait_for(lambda: connected(running), START_S, "the nodes to find each other")
    for moment in moments:
        feed(running, moment)
        assert [running.answer(stage, moment.stamp_ns) for stage in STAGES] == ["published"] * 3, running.log(
            "/registrar"
        )
    for stage in STAGES:
        counters = running.balance(f"/{stage}", received=len(moments))
        assert (counters.published, counters.dropped, counters.lost) == (len(moments), {}, {}), stage
    stamps = [moment.stamp_ns for moment in moments]
    for topic in WIRE:
        assert [headers.stamp_ns(message) for message in running.received[topic]] == stamps, topic
    assert sum(message.width for message in running.received["objects"]) > 0


def test_a_jump_back_in_time_goes_on_like_a_looped_bag(running: Graph, moments: list[Moment]) -> None:
    before = len(running.received["objects"])
    for moment in moments[:3]:
        running.received["finished"].clear()
        feed(running, moment)
        assert [running.answer(stage, moment.stamp_ns) for stage in STAGES] == ["published"] * 3
    assert len(running.received["objects"]) == before + 3


def test_a_disabled_registrar_drops_its_frames_as_disabled_until_it_is_enabled(
    running: Graph, moments: list[Moment]
) -> None:
    for on, expected in ((False, "dropped disabled"), (True, "published")):
        assert call(running, SetBool, "registrar/enable", data=on)[0]
        running.received["finished"].clear()
        feed(running, moments[3])
        assert running.answer("registrar", moments[3].stamp_ns) == expected


def test_the_registrar_ends_its_keyframe_to_save_and_forgets_on_demand(running: Graph) -> None:
    saved, why = call(running, Trigger, "registrar/save")
    assert not saved and "got a temporary one" in why
    running.wait_for(lambda: bool(running.received["landmarks"]), what="the objects of the keyframe that was saved")
    assert all((table(message, "object_id")["object_id"] >= 1).all() for message in running.received["landmarks"])
    running.wait_for(lambda: bool(running.received["refusals"]), what="why the two runs of the clock are not tied")
    assert all(refusal_of(status).detail for message in running.received["refusals"] for status in message.status)
    assert call(running, Trigger, "registrar/reset") == (True, "forgot every keyframe")


def test_a_late_subscriber_still_gets_the_labels(running: Graph) -> None:
    from std_msgs.msg import String

    running.receive(String, "labels", qos.latched())
    running.wait_for(lambda: bool(running.received["labels"]), what="labels")
    assert "cup" in from_msg.labels(running.received["labels"][0]).values()


def test_an_interrupt_ends_every_node_with_status_0(running: Graph) -> None:
    assert {name: running.stop(name) for name in list(running.processes)} == {f"/{stage}": 0 for stage in STAGES}
