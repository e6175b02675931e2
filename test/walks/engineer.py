# SPDX-License-Identifier: Apache-2.0
"""A SLAM engineer starts the nodes in a namespace with a driver's topic names, and listens."""

from __future__ import annotations

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from ros.graph import Graph

from objreg_ros.bridge.messages import from_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.diagnostics import refusal_of

from .walk import PATIENCE_S, Walk

STAGES = ("detector", "segmenter", "registrar")
FRAMES = 17  # of the first 15 s of the room
ROBOT = "/fleet/robot_7"
DRIVER = {"image": "/kinect/rgb/raw", "depth/image": "/kinect/depth/raw", "camera_info": "/kinect/info"}
RULES = [f"-r __ns:={ROBOT}", *(f"-r {name}:={topic}" for name, topic in DRIVER.items())]
BEHIND = ["--", "--ros-args", *(word for rule in RULES for word in rule.split(" "))]


def walk(graph: Graph, folder: Path, room: Path) -> None:
    """Start, play, receive: constraints, refusals, and counters that balance."""
    for name in STAGES:
        graph.start(f"{ROBOT}/{name}", name, *RULES, *(["-p reliable:=true"] if name != "registrar" else []))
    graph.receive(Odometry, f"{ROBOT}/constraints", qos.latched(depth=1000))
    graph.receive(DiagnosticArray, f"{ROBOT}/refusals")
    graph.wait_for(lambda: len(graph.counters) == 3, PATIENCE_S, "three nodes")

    engineer = Walk(folder)
    _play_where_nobody_listens(engineer, room)
    played = engineer.type("replay", str(room), "--lossless", "--end", "15", "--wait", str(PATIENCE_S), *BEHIND)
    assert all(f"{stage}: {FRAMES} published" in played.text for stage in STAGES), played.text

    graph.wait_for(lambda: bool(graph.received[f"{ROBOT}/constraints"]), what="a constraint")
    closure = from_msg.loop_closure(graph.received[f"{ROBOT}/constraints"][0])
    assert closure.covariance.shape == (6, 6) and closure.from_ns != closure.to_ns
    graph.wait_for(lambda: bool(graph.received[f"{ROBOT}/refusals"]), what="a refusal")
    assert refusal_of(graph.received[f"{ROBOT}/refusals"][0].status[0])
    _require_balance(graph)


def _play_where_nobody_listens(engineer: Walk, room: Path) -> None:
    """A replay that forgets the namespace says that nobody listens, and how to look."""
    forgot = engineer.type("replay", str(room), "--end", "1", "--wait", "1")
    assert "nobody listens to /image" in forgot.text
    assert forgot.advises("objreg_graph") and forgot.advises("-r __ns:=/")


def _require_balance(graph: Graph) -> None:
    """Every node soon reports that all frames are through, and each was published or dropped."""
    graph.wait_for(
        lambda: all(counters.published == FRAMES for counters in graph.counters.values()), what="the counters"
    )
    for counters in graph.counters.values():
        assert counters.received == counters.published + counters.waiting + sum(counters.dropped.values())
