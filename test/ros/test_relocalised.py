# SPDX-License-Identifier: Apache-2.0
"""A registrar that is started in a known place states where it is, on a topic and when asked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from registration import rooms
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.streams import relocalised
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar

from .graph import START_S, Graph

pytestmark = pytest.mark.ros

HERE = rooms.look_at((0.2, 0.0, 1.3), (1.8, 0.0, 0.75))
BESIDE = rooms.look_at((0.35, 0.25, 1.25), (1.8, 0.0, 0.75))
T_ODOM_MAP = pose(rotation_from_vector(np.array([0.0, 0.0, 0.8])), np.array([1.0, 2.0, 0.0]))


MOUNT = "-p T_base_camera:=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]"


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def frame(seconds: int, T_odom_camera: Array, T_world_camera: Array) -> Frame:
    seen = rooms.keyframe(T_world_camera, seed=seconds)
    return Frame(
        objects=tuple(item.cloud for item in seen.objects),
        support=None,
        view=seen.view,
        gravity=seen.gravity,
        gravity_confidence=1.0,
        T_odom_camera=T_odom_camera,
        stamp_ns=seconds * 1_000_000_000,
    )


def remember(store: Path) -> None:
    """The earlier session."""
    with closing(Registrar(RegistrarParams(store=str(store)))) as registrar:
        for k, T in enumerate((HERE, BESIDE)):
            registrar.process(frame(10 + 3 * k, T, T))
        registrar.finish()


def send_frame(graph: Graph, seen: Frame, names: dict[int, str]) -> None:
    assert seen.T_odom_camera is not None
    odometry = Odometry(T_odom_body=seen.T_odom_camera, stamp_ns=seen.stamp_ns, child_frame_id=seen.frame_id)
    for topic, message in {
        "labels": to_msg.labels(names),
        "odom": to_msg.odometry(odometry),
        "objects": to_msg.objects(seen, names),
        "view": to_msg.view(seen),
        "view/camera_info": to_msg.view_camera_info(seen),
        "gravity": to_msg.gravity(seen),
    }.items():
        graph.publish(topic, message)


def ask(graph: Graph, kind: type, service: str) -> Any:
    client = graph.node.create_client(kind, service)
    graph.wait_for(client.service_is_ready, START_S, service)
    answer = client.call_async(kind.Request())
    graph.wait_for(answer.done, what=service)
    return answer.result()


def test_a_registrar_with_the_store_of_an_earlier_session_states_where_it_woke_up(fresh: Graph, tmp_path: Path) -> None:
    store = tmp_path / "place.db"
    remember(store)
    asking = relocalised.Relocalise or Trigger
    fresh.receive(Header, "finished")
    fresh.receive(PoseWithCovarianceStamped, "relocalised", qos.latched())
    fresh.receive(PoseWithCovarianceStamped, "initialpose")
    parameters = (f"-p store:={store}", "-p map_frame:=map", "-p initialpose:=true", "-p reliable:=true", MOUNT)
    fresh.start("registrar", "registrar", *parameters)
    answer = ask(fresh, asking, "registrar/relocalise")
    assert not answer.success and answer.message == "no closure to an earlier session yet"
    later = [(100, BESIDE), (103, HERE)]
    frames = [frame(seconds, T_ODOM_MAP @ T, T) for seconds, T in later]
    names = dict(enumerate(sorted({cloud.label for one in frames for cloud in one.objects})))
    for one in (*frames, replace(frames[-1], stamp_ns=frames[-1].stamp_ns + 2_000_000_000)):
        send_frame(fresh, one, names)
        fresh.answer("registrar", one.stamp_ns)
    ask(fresh, Trigger, "registrar/save")
    fresh.wait_for(lambda: bool(fresh.received["relocalised"] and fresh.received["initialpose"]), what="where it is")
    (published,) = fresh.received["relocalised"]
    at = published.pose.pose.position
    assert published.header.frame_id == "map" and np.abs(np.array([at.x, at.y, at.z]) - HERE[:3, 3]).max() < 0.05
    assert fresh.received["initialpose"][0].pose.pose.position.z == 0.0
    answer = ask(fresh, asking, "registrar/relocalise")
    assert answer.success, answer.message
    if relocalised.Relocalise is not None:
        assert answer.session == "0"
    fresh.wait_for(lambda: len(fresh.received["relocalised"]) == 2, what="the answer on the topic")
