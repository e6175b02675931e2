# SPDX-License-Identifier: Apache-2.0
"""The node in this process: what makes a file, what is in it, and a folder that takes none."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image
from std_msgs.msg import Header, String

from objreg_ros.blackbox.node import DECISIONS, INPUTS, KEPT, BlackboxNode, state_of
from objreg_ros.blackbox.recent import Part, Source
from objreg_ros.bridge.messages import localisation_msg, to_msg
from objreg_ros.bridge.node.diagnostics import refusals
from objreg_ros.data.closures import Reason, Rejected
from objreg_ros.data.localisation import LocalisationState, State
from objreg_tools.recording import open_recording

S = 1_000_000_000
DEPTH = Source("/depth/image", "sensor_msgs/msg/Image", Part.DEPTH)
REFUSALS = Source("/refusals", "diagnostic_msgs/msg/DiagnosticArray", Part.DECISION)


@pytest.fixture
def box(tmp_path: Path) -> Iterator[Callable[..., BlackboxNode]]:
    """Makes the node with some parameters; its folder is ``tmp_path / "box"`` unless another is given."""
    made = list[BlackboxNode]()

    def make(**values: Any) -> BlackboxNode:
        given = {"blackbox_seconds": 5.0, "blackbox_folder": str(tmp_path / "box"), **values}
        words = [word for name, value in given.items() for word in ("-p", f"{name}:={json.dumps(value)}")]
        rclpy.init(args=["--ros-args", *words])
        made.append(BlackboxNode())
        return made[-1]

    yield make
    for node in made:
        node.close()
    rclpy.try_shutdown()


def see(node: BlackboxNode, first_s: int, count: int = 20) -> None:
    for k in range(count):
        stamp = to_msg.stamp(first_s * S + k * S // 10)
        node._keep_leading(DEPTH, serialize_message(Image(header=Header(stamp=stamp))))


def refuse(node: BlackboxNode, reason: Reason, at_s: int) -> None:
    no = Rejected(reason=reason, from_ns=at_s * S, to_ns=at_s * S + 1, detail="by much")
    node._decide("refusals", REFUSALS, serialize_message(refusals("/registrar", to_msg.stamp(at_s * S), [no])))


def wait(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def about(path: Path) -> dict[str, Any]:
    with open_recording(path) as opened:
        (record,) = opened.records(["/blackbox"])
        return json.loads(record.message.data)


def test_it_receives_all_that_the_other_nodes_do(box: Callable[..., BlackboxNode]) -> None:
    node = box()
    listened = {subscription.topic_name for subscription in node.subscriptions}
    expected = {node.resolve_topic_name(topic) for topic, (kind, _) in INPUTS.items() if kind.split("/")[0] not in
                ("tf2_msgs", "vision_msgs")}  # fmt: skip
    assert expected | {node.resolve_topic_name(topic) for topic in DECISIONS} <= listened
    assert KEPT.keys() <= INPUTS.keys()


def test_a_refusal_of_a_chosen_reason_writes_one_file_and_the_next_is_passed_over(
    box: Callable[..., BlackboxNode], tmp_path: Path
) -> None:
    node = box(blackbox_reasons=["low_overlap"])
    see(node, 100)
    refuse(node, Reason.REDUNDANT, 101)
    refuse(node, Reason.LOW_OVERLAP, 101)
    refuse(node, Reason.LOW_OVERLAP, 101)
    wait(lambda: node.accounting.balance().published == 1)
    (path,) = (tmp_path / "box").glob("*.mcap")
    said = about(path)
    assert (said["event"], said["detail"], said["to_ns"]) == ("low_overlap", "by much", 101 * S + 1)
    assert said["inside"] == {"from_ns": True, "to_ns": True} and "low_overlap" in path.name
    assert node.own_diagnostics()[-1].passed_over == 1
    with open_recording(path) as opened:
        assert {name: topic.count for name, topic in opened.topics.items()} == {
            "/depth/image": 20,
            "/refusals": 3,
            "/blackbox": 1,
        }


def test_a_folder_that_cannot_be_written_is_counted_and_said_and_the_node_goes_on(
    box: Callable[..., BlackboxNode], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    node = box(blackbox_folder=str(tmp_path / "file" / "box"), blackbox_reasons=["low_overlap"])
    see(node, 100)
    refuse(node, Reason.LOW_OVERLAP, 101)
    wait(lambda: node.accounting.balance().dropped == {"refused": 1})
    done, why = node._write_when_called()
    assert not done and "expected a place that takes it" in why
    assert not node.failure.done() and node.accounting.balance().dropped == {"refused": 2}


def test_one_odd_stamp_moves_nothing_and_its_message_is_in_the_file(box: Callable[..., BlackboxNode]) -> None:
    node = box()
    see(node, 100, 10)
    see(node, 9000, 1)
    see(node, 101, 10)
    done, path = node._write_when_called()
    said = about(Path(path))
    assert done and (said["begin_ns"], said["end_ns"]) == (100 * S, round(101.9 * S))
    with open_recording(Path(path)) as opened:
        assert opened.topics["/depth/image"].count == 21


def test_a_bag_that_begins_anew_begins_a_new_file(box: Callable[..., BlackboxNode]) -> None:
    node = box()
    see(node, 100)
    see(node, 50)
    assert about(Path(node._write_when_called()[1]))["begin_ns"] == 50 * S
    assert node.own_diagnostics()[-1].jumps == 1


def test_it_is_off_without_seconds_and_says_so_when_called(box: Callable[..., BlackboxNode]) -> None:
    node = box(blackbox_seconds=0.0)
    assert not list(node.subscriptions) or all("parameter" in one.topic_name for one in node.subscriptions)
    assert node._write_when_called() == (False, "expected blackbox_seconds over 0 and inputs with stamps, got none yet")


def test_a_status_that_is_no_refusal_is_counted_and_dropped(box: Callable[..., BlackboxNode]) -> None:
    node = box()
    see(node, 100)
    odd = DiagnosticArray(status=[DiagnosticStatus(message="nothing")])
    node._decide("refusals", REFUSALS, serialize_message(odd))
    assert not node.failure.done() and node.accounting.balance().received == 0


def test_a_camera_that_becomes_lost_writes_a_file(box: Callable[..., BlackboxNode], tmp_path: Path) -> None:
    node = box()
    see(node, 100)
    source = Source("/localisation_state", "std_msgs/msg/String", Part.DECISION)
    for state in ("SURE", "LOST", "LOST"):
        node._on_state(source, String, serialize_message(String(data=state)))
    wait(lambda: node.accounting.balance().published == 1)
    assert [path.name[-9:] for path in (tmp_path / "box").glob("*.mcap")] == ["lost.mcap"]


def test_a_registrar_that_says_lost_writes_a_file_with_what_it_said(
    box: Callable[..., BlackboxNode], tmp_path: Path
) -> None:
    kind = localisation_msg.LocalisationStateMsg
    if kind is None:
        pytest.skip("objreg_msgs is not installed: colcon builds it from this repository")
    node = box()
    see(node, 100)
    source = Source("/localisation_state", "objreg_msgs/msg/LocalisationState", Part.DECISION)
    for state in (State.SURE, State.AMBIGUOUS, State.LOST, State.KIDNAPPED):
        now = LocalisationState(
            stamp_ns=101 * S, state=state, reason="by 3 m", age_s=1.0, odds=0.5, probability=0.4, sigma_m=0.1
        )
        node._on_state(source, kind, serialize_message(localisation_msg.localisation_state(now, "eye")))
        assert node.own_diagnostics()[-1].passed_over == 0, state
    wait(lambda: node.accounting.balance().published == 1)
    (path,) = (tmp_path / "box").glob("*.mcap")
    assert (about(path)["event"], about(path)["detail"]) == ("lost", "LOST: by 3 m")
    with open_recording(path) as opened:
        said = [record.message for record in opened.records(["/localisation_state"])]
    assert [State(one.state) for one in said][:3] == [State.SURE, State.AMBIGUOUS, State.LOST]
    lost = said[2]
    assert (lost.header.stamp.sec, lost.header.frame_id, lost.reason, lost.odds) == (101, "eye", "by 3 m", 0.5)


def test_a_state_is_text_or_a_constant_of_its_message() -> None:
    class Message:
        SURE, LOST = 1, 3

    message = Message()
    message.state, message.reason = 3, "nothing fits"  # type: ignore[attr-defined]
    assert state_of(message) == ("LOST", "nothing fits")
    assert state_of(SimpleNamespace(data="sure")) == ("sure", "")
    with pytest.raises(ValueError, match="expected a state"):
        state_of(SimpleNamespace())
