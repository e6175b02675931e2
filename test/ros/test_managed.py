# SPDX-License-Identifier: Apache-2.0
"""A managed node through its life: configured, active, inactive, active again, shut down."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from .graph import ANSWER_S, START_S, Graph
from .moments import Moment, drawn

pytestmark = pytest.mark.ros

CONFIGURE, CLEAN_UP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE
SHUTDOWN = Transition.TRANSITION_ACTIVE_SHUTDOWN
MANAGED = ("-p managed:=true", "-p autostart:=false")


@pytest.fixture
def alone(domain: int, tmp_path: Path) -> Iterator[Graph]:
    """A graph without nodes, for one test."""
    made = Graph(domain, tmp_path)
    made.receive(Header, "finished")
    yield made
    made.close()


def ask(graph: Graph, kind: type, name: str, request: object) -> object:
    client = graph.node.create_client(kind, name)
    graph.wait_for(client.service_is_ready, START_S, name)
    future = client.call_async(request)
    graph.wait_for(future.done, START_S, f"the answer of {name}")  # a start or a configure may compile
    return future.result()


def change(graph: Graph, node: str, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return ask(graph, ChangeState, f"/{node}/change_state", request).success


def state(graph: Graph, node: str) -> str:
    return ask(graph, GetState, f"/{node}/get_state", GetState.Request()).current_state.label


def put(graph: Graph, node: str, name: str, value: object) -> str:
    """Set a parameter; what it was refused for, nothing if it was not."""
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return ask(graph, SetParameters, f"/{node}/set_parameters", request).results[0].reason


def show(graph: Graph, moment: Moment) -> str:
    graph.publish("image", moment.messages["image"])
    return graph.answer("detector", moment.stamp_ns)


def test_a_managed_detector_is_configured_lets_frames_in_while_active_and_ends_when_it_is_shut_down(
    alone: Graph, tiny_model: Path, tmp_path: Path
) -> None:
    frames = drawn(5)
    alone.start("/detector", "detector", f"-p model:={tmp_path}/none.onnx", "-p reliable:=true", *MANAGED)
    assert state(alone, "detector") == "unconfigured"
    assert not change(alone, "detector", CONFIGURE) and state(alone, "detector") == "unconfigured"
    (line,) = (line for line in alone.log("/detector").splitlines() if "ERROR" in line)
    assert "not configured: " in line and "none.onnx" in line and "expected" in line

    assert "expected" in put(alone, "detector", "threshold", 2.0)
    assert put(alone, "detector", "model", str(tiny_model)) == ""
    assert change(alone, "detector", CONFIGURE) and state(alone, "detector") == "inactive"
    assert "model: expected to be changed while unconfigured" in put(alone, "detector", "model", "other.onnx")
    assert put(alone, "detector", "managed", False) and put(alone, "detector", "threshold", 0.4) == ""
    assert show(alone, next(frames)) == "dropped inactive"

    assert change(alone, "detector", ACTIVATE) and show(alone, next(frames)) == "published"
    assert change(alone, "detector", DEACTIVATE) and show(alone, next(frames)) == "dropped inactive"
    assert change(alone, "detector", ACTIVATE) and show(alone, next(frames)) == "published"
    balance = alone.balance("/detector", 4)
    assert (balance.published, balance.dropped) == (2, {"inactive": 2})
    assert {"active"} == {pair.value for pair in alone.status["/detector"].values if pair.key == "state"}

    assert change(alone, "detector", DEACTIVATE) and change(alone, "detector", CLEAN_UP)
    alone.wait_for(lambda: not alone.connected["/detector"], what="the detector to listen to nothing")
    alone.wait_for(lambda: ("detector", "/") in alone.node.get_node_names_and_namespaces(), what="the detector's name")
    topics = {topic for topic, _ in alone.node.get_publisher_names_and_types_by_node("detector", "/")}
    assert "/finished" in topics
    assert change(alone, "detector", CONFIGURE) and change(alone, "detector", ACTIVATE)
    alone.wait_for(lambda: bool(alone.connected["/detector"]), what="the detector to listen again")
    assert show(alone, next(frames)) == "published" and alone.balance("/detector", 1).dropped == {}

    process = alone.processes.pop("/detector")
    client = alone.node.create_client(ChangeState, "/detector/change_state")
    alone.wait_for(client.service_is_ready, what="the service")
    answer = client.call_async(ChangeState.Request(transition=Transition(id=SHUTDOWN)))
    alone.wait_for(answer.done, what="the answer to the shutdown")
    assert answer.result().success and process.wait(ANSWER_S) == 0, alone.log("/detector")
    assert "Traceback" not in alone.log("/detector")


def test_a_managed_registrar_lets_go_of_its_store_and_opens_it_again(alone: Graph, tmp_path: Path) -> None:
    store = tmp_path / "store.db"
    alone.start("/registrar", "registrar", f"-p store:={store}", *MANAGED)
    for _ in range(2):
        assert change(alone, "registrar", CONFIGURE) and change(alone, "registrar", ACTIVATE)
        assert ask(alone, Trigger, "/registrar/save", Trigger.Request()).success
        assert change(alone, "registrar", DEACTIVATE) and change(alone, "registrar", CLEAN_UP)
    assert state(alone, "registrar") == "unconfigured" and store.is_file()
    assert alone.stop("/registrar") == 0


@pytest.mark.parametrize("stage", ["segmenter", "mapper"])
def test_a_managed_node_starts_by_itself_where_it_may_and_a_signal_ends_it(alone: Graph, stage: str) -> None:
    alone.start(f"/{stage}", stage, "-p managed:=true")
    assert state(alone, stage) == "active"
    for transition in (DEACTIVATE, CLEAN_UP, CONFIGURE):
        assert change(alone, stage, transition), alone.log(f"/{stage}")
    assert state(alone, stage) == "inactive" and alone.stop(f"/{stage}") == 0


def test_nodes_of_one_process_are_not_managed(alone: Graph) -> None:
    alone.start_composed("mapper", "--ros-args", "-p", "managed:=true")
    process = alone.processes.pop("graph")
    assert process.wait(START_S) == 1
    assert alone.log("graph").splitlines()[-1].startswith("mapper: managed: expected false")
