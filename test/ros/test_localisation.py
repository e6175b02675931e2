# SPDX-License-Identifier: Apache-2.0
"""A registrar says that it is sure of where it is, and that it was carried elsewhere behind odometry's back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import closures_msg, headers, localisation_msg, to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.localisation import LocalisationState, State

from .graph import START_S, Graph
from .test_blackbox import about
from .test_relocalised import BESIDE, HERE, MOUNT, T_ODOM_MAP, ask, frame, remember, send_frame

pytestmark = pytest.mark.ros
SEARCH = "-p kidnapping_search:=true"
with_messages = pytest.mark.skipif(
    localisation_msg.LocalisationStateMsg is None,
    reason="objreg_msgs is not installed: colcon builds it from this repository",
)


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
    fresh.start("registrar", "registrar", f"-p store:={store}", "-p reliable:=true", SEARCH, MOUNT)
    T_carried = T_ODOM_MAP.copy()  # where odometry's frame is in the map once it has missed two metres
    T_carried[0, 3] += 2.0
    steps = [(100, T_ODOM_MAP @ BESIDE, BESIDE), (103, T_ODOM_MAP @ HERE, HERE)]
    steps += [(106, T_carried @ BESIDE, BESIDE), (109, T_carried @ HERE, HERE), (112, T_carried @ BESIDE, BESIDE)]
    frames = [frame(*step) for step in steps]
    names = dict(enumerate(sorted({cloud.label for one in frames for cloud in one.objects})))
    for k, one in enumerate(frames):
        send_frame(fresh, one, names)
        fresh.answer("registrar", one.stamp_ns)
        ask(fresh, Trigger, "registrar/save")
        if k == 1:
            fresh.wait_for(lambda: State.SURE.name in states(fresh), what=f"sure: {states(fresh)}")
    fresh.wait_for(lambda: State.KIDNAPPED.name in states(fresh), what=f"kidnapped: {states(fresh)}")


@with_messages
def test_the_topic_says_what_diagnostics_say_with_the_closure_behind_it(fresh: Graph, tmp_path: Path) -> None:
    store = tmp_path / "place.db"
    remember(store)
    fresh.receive(Header, "finished")
    fresh.receive(DiagnosticArray, "/diagnostics")
    fresh.receive(localisation_msg.LocalisationStateMsg, "localisation_state", qos.latched(100))
    fresh.receive(closures_msg.LoopClosureMsg, "loop_closures", qos.latched(qos.KEPT_CONSTRAINTS))
    fresh.start("registrar", "registrar", f"-p store:={store}", "-p reliable:=true", SEARCH, MOUNT)
    frames = [frame(seconds, T_ODOM_MAP @ T, T) for seconds, T in ((100, BESIDE), (103, HERE), (106, BESIDE))]
    names = dict(enumerate(sorted({cloud.label for one in frames for cloud in one.objects})))
    for one in frames:
        send_frame(fresh, one, names)
        fresh.answer("registrar", one.stamp_ns)
    ask(fresh, Trigger, "registrar/save")
    said = fresh.received["localisation_state"]
    fresh.wait_for(
        lambda: bool(said) and said[-1].state == said[-1].SURE and states(fresh)[-1:] == ["SURE"], what="sure"
    )
    assert {State(one.state).name for one in said} >= {"TRACKING", *states(fresh)}
    assert {headers.stamp_ns(one) for one in said} <= {one.stamp_ns for one in frames}
    first, last = said[0], said[-1]
    assert (first.closure_id, first.header.frame_id) == ("", frames[0].frame_id) and np.isnan(first.probability)
    assert last.closure_id in {one.id for one in fresh.received["loop_closures"]} and last.closure_age >= 0.0
    assert 0.9 <= last.probability <= 1.0 and 0.0 < last.sigma < 0.5 and "within 0.5 m" in last.reason


def kept(graph: Graph) -> int:
    """The messages that the black box says that it keeps."""
    values = {one.key: one.value for one in graph.status["/blackbox"].values} if "/blackbox" in graph.status else {}
    return int(values.get("kept messages", "0").split()[0])


@with_messages
def test_a_black_box_makes_a_file_of_a_state_that_is_published(fresh: Graph, tmp_path: Path) -> None:
    kind = localisation_msg.LocalisationStateMsg
    states_out = fresh.node.create_publisher(kind, "localisation_state", qos.latched(10))
    clock = fresh.node.create_publisher(Image, "depth/image", qos.stage())
    given = ("-p blackbox_seconds:=5.0", f"-p blackbox_folder:={tmp_path}", "-p reliable:=true")
    fresh.start("blackbox", "blackbox", *given)
    for one in (clock, states_out):
        fresh.wait_for(lambda one=one: one.get_subscription_count() == 1, START_S, one.topic_name)
    stamps = [100_000_000_000 + k * 100_000_000 for k in range(20)]
    for stamp_ns in stamps:
        clock.publish(Image(header=to_msg.header(stamp_ns, "eye")))
    fresh.wait_for(lambda: kept(fresh) > 0, what="the black box to keep a picture")
    for state in (State.SURE, State.LOST):
        now = LocalisationState(
            stamp_ns=stamps[-1], state=state, reason="by 3 m", age_s=1.0, odds=0.5, probability=0.4, sigma_m=0.1
        )
        states_out.publish(localisation_msg.localisation_state(now, "eye"))
    fresh.balance("/blackbox", 1)
    (file,) = tmp_path.glob("*.mcap")
    assert (about(file)["event"], about(file)["detail"]) == ("lost", "LOST: by 3 m")
