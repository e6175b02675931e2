# SPDX-License-Identifier: Apache-2.0
"""A registrar says that it is sure of where it is, and that it was carried elsewhere behind odometry's back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import localisation_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.localisation import State

from .graph import Graph
from .test_relocalised import BESIDE, HERE, MOUNT, T_ODOM_MAP, ask, frame, remember, tell

pytestmark = pytest.mark.ros


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def states(graph: Graph) -> list[str]:
    """What /diagnostics said of the localisation until now, each state once in a row."""
    found: list[str] = []
    for message in graph.received["/diagnostics"]:
        for status in message.status:
            said = next((one.value.partition(":")[0] for one in status.values if one.key == "localisation"), "")
            if said and said != (found[-1] if found else None):
                found.append(said)
    return found


def test_a_robot_that_is_carried_elsewhere_is_kidnapped_once_closures_agree(fresh: Graph, tmp_path: Path) -> None:
    store = tmp_path / "place.db"
    remember(store)
    fresh.receive(Header, "finished")
    fresh.receive(DiagnosticArray, "/diagnostics")
    if localisation_msg.LocalisationStateMsg is not None:
        fresh.receive(localisation_msg.LocalisationStateMsg, "localisation_state", qos.latched())
    fresh.start("registrar", "registrar", f"-p store:={store}", "-p reliable:=true", MOUNT)
    T_carried = T_ODOM_MAP.copy()  # where odometry's frame is in the map once it has missed two metres
    T_carried[0, 3] += 2.0
    steps = [(100, T_ODOM_MAP @ BESIDE, BESIDE), (103, T_ODOM_MAP @ HERE, HERE)]
    steps += [(106, T_carried @ BESIDE, BESIDE), (109, T_carried @ HERE, HERE), (112, T_carried @ BESIDE, BESIDE)]
    frames = [frame(*step) for step in steps]
    names = dict(enumerate(sorted({cloud.label for one in frames for cloud in one.objects})))
    for k, one in enumerate(frames):
        tell(fresh, one, names)
        fresh.answer("registrar", one.stamp_ns)
        ask(fresh, Trigger, "registrar/save")
        if k == 1:
            fresh.wait_for(lambda: State.SURE.name in states(fresh), what=f"sure: {states(fresh)}")
    fresh.wait_for(lambda: State.KIDNAPPED.name in states(fresh), what=f"kidnapped: {states(fresh)}")
