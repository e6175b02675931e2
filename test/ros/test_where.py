# SPDX-License-Identifier: Apache-2.0
"""A live registrar says where the objects of a label are, in the odometry of now, by objreg_msgs/Where."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from registration import rooms
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import headers, known_objects_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform

from .graph import Graph
from .test_peer import call
from .test_relocalised import BESIDE, HERE, MOUNT, T_ODOM_MAP, ask, frame, remember, send_frame

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(known_objects_msg.Where is None, reason="objreg_msgs is not installed"),
]
LABEL = "bottle"
WITHIN_M = 0.1  # the middle of what is seen of it lies before its own middle
SIGMAS = 3.0


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def middle(label: str) -> Array:
    """Of a thing of the simulated room (3,) m."""
    low, high = next((low, high) for name, low, high in rooms.ROOM if name == label)
    return np.add(low, high) / 2.0


def where(graph: Graph, label: str) -> Any:
    return call(graph, known_objects_msg.Where, "registrar/where", label=label)


def test_a_registrar_says_where_a_thing_is_in_the_odometry_of_now(fresh: Graph, tmp_path: Path) -> None:
    store = tmp_path / "place.db"
    remember(store)
    fresh.receive(Header, "finished")
    fresh.receive(PoseWithCovarianceStamped, "relocalised", qos.latched())
    fresh.start("registrar", "registrar", f"-p store:={store}", "-p reliable:=true", MOUNT)
    answer = where(fresh, LABEL.upper())
    assert not answer.success and not answer.landmarks and answer.session == ""
    assert "1 in sessions that nothing ties to this one" in answer.message

    frames = [frame(seconds, T_ODOM_MAP @ T, T) for seconds, T in ((100, BESIDE), (103, HERE), (106, BESIDE))]
    names = dict(enumerate(sorted({cloud.label for one in frames for cloud in one.objects})))
    for one in frames:
        send_frame(fresh, one, names)
        fresh.answer("registrar", one.stamp_ns)
    ask(fresh, Trigger, "registrar/save")
    fresh.wait_for(lambda: bool(fresh.received["relocalised"]), what="the closures, which wait for proof of the camera")
    answer = where(fresh, LABEL.upper())
    assert answer.success and answer.message == "1 here"
    assert answer.header.frame_id == "odom" and (answer.robot, answer.session) == ("", "1")
    (place,) = answer.landmarks
    assert (place.landmark.label, place.sightings, place.session) == (LABEL, 5, "1")
    assert place.last_seen == answer.header.stamp and headers.stamp_ns(answer) == frames[-1].stamp_ns
    at = place.landmark.position
    error = np.array([at.x, at.y, at.z]) - transform(T_ODOM_MAP, middle(LABEL))
    covariance = np.array(place.landmark.position_covariance).reshape(3, 3)
    assert np.linalg.norm(error) < WITHIN_M and error @ np.linalg.solve(covariance, error) < SIGMAS**2
    assert 0.2 < place.extent < 0.4

    everything, nothing = where(fresh, ""), where(fresh, "sofa")
    assert {one.landmark.label for one in everything.landmarks} > {LABEL, "cup"}
    assert (
        not nothing.success and nothing.message.startswith("no sofa is known; there are: ") and LABEL in nothing.message
    )
