# SPDX-License-Identifier: Apache-2.0
"""What every adapter makes of what comes in, bad input too."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from objreg_mapper.adapters.adapter import Adapter
from objreg_ros.bridge.messages import closures_msg, to_msg
from objreg_ros.data.closures import LoopClosure, Moments
from objreg_ros.diagnostics import by_key

from .standing_by import Around, closure


class MessagesByStamp(Adapter):
    """A consumer that takes what it is open for, and stumbles over what comes from 13 s."""

    def __init__(self) -> None:
        super().__init__("shelf")
        self.is_open = True
        self.has: list[Moments] = []
        self.listen_for_closures()

    def hand_over(self, closure: LoopClosure) -> bool:
        if closure.from_ns == 13_000_000_000:
            raise IndexError("nobody expected this")
        if self.is_open:
            self.has.append(closure.moments)
        return self.is_open


def publish_whole(graph: Around, one: LoopClosure, retracted: bool = False) -> None:
    if graph.whole is None:
        pytest.skip("objreg_msgs is not installed: colcon builds it from this repository")
    message = closures_msg.loop_closure(one)
    message.retracted = retracted
    graph.whole.publish(message)


def test_a_constraint_that_comes_by_both_topics_is_taken_once(around: Callable[..., Any]) -> None:
    graph = around()
    node = graph.start(MessagesByStamp)
    publish_whole(graph, closure())
    graph.send(closure(), closure())
    graph.wait(lambda: node.has and by_key(*node.own_diagnostics())["repeated"] == 2)
    assert len(node.has) == 1 and node.accounting.balance().published == 1


@pytest.mark.parametrize(("topic", "count"), [("loop_closures", 1), ("constraints", 2)])
def test_one_topic_is_received_where_one_is_named(around: Callable[..., Any], topic: str, count: int) -> None:
    graph = around(f"input:={topic}")
    publish_whole(graph, closure())
    graph.send(closure(2.0), closure(3.0))
    node = graph.start(MessagesByStamp)
    graph.wait(lambda: len(node.has) == count)
    graph.pass_time(0.3)
    assert node.accounting.balance().received == count


def test_a_topic_without_its_messages_is_refused_at_start(
    around: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(closures_msg, "LoopClosureMsg", None)
    around("input:=loop_closures")
    with pytest.raises(ValueError, match=r"objreg_msgs.*input:=constraints"):
        MessagesByStamp()


def test_bad_input_and_bugs_end_nothing_and_are_counted(around: Callable[..., Any]) -> None:
    graph = around()
    node = graph.start(MessagesByStamp)
    nameless = to_msg.constraint(closure())
    nameless.header.frame_id = "camera"
    twisted = to_msg.constraint(closure())
    twisted.pose.covariance[0] = float("nan")
    for message in (nameless, twisted):
        graph.constraints.publish(message)
    graph.send(closure(13.0), closure())
    graph.wait(lambda: node.accounting.balance().published == 1)
    assert node.accounting.balance().dropped == {"malformed_constraints": 2, "bug (IndexError)": 1}


def test_what_waits_is_bounded_and_goes_once_the_consumer_is_there(around: Callable[..., Any]) -> None:
    graph = around("most_waiting:=2")
    node = graph.start(MessagesByStamp)
    node.is_open = False
    graph.send(closure(1.0), closure(2.0), closure(3.0))
    graph.wait(lambda: node.accounting.balance().dropped == {"queue_full": 1})
    assert node.accounting.balance().waiting == 2
    node.is_open = True
    graph.wait(lambda: len(node.has) == 2)
    assert [from_ns for _, from_ns, _, _ in node.has] == [2_000_000_000, 3_000_000_000]


def test_what_is_withdrawn_while_it_waits_never_goes_and_later_it_is_reported(around: Callable[..., Any]) -> None:
    graph = around()
    node = graph.start(MessagesByStamp)
    node.is_open = False
    publish_whole(graph, closure(1.0))
    publish_whole(graph, closure(1.0), retracted=True)
    graph.wait(lambda: node.accounting.balance().dropped == {"retracted": 1})
    node.is_open = True
    publish_whole(graph, closure(2.0))
    graph.wait(lambda: len(node.has) == 1)
    publish_whole(graph, closure(2.0), retracted=True)
    graph.wait(lambda: by_key(*node.own_diagnostics())["retracted too late"] == 1)


def test_what_was_withdrawn_stays_out_when_the_other_topic_brings_it(around: Callable[..., Any]) -> None:
    graph = around("input:=constraints")
    node = graph.start(MessagesByStamp)
    graph.send(closure())
    graph.wait(lambda: len(node.has) == 1)
    node._keys["its id"] = node.has[0]
    for _ in range(2):
        node._retract("its id")
    assert by_key(*node.own_diagnostics())["retracted too late"] == 1
    graph.send(closure(), closure(2.0))
    graph.wait(lambda: len(node.has) == 2)
    assert by_key(*node.own_diagnostics())["repeated"] == 1


def test_what_is_on_its_way_is_not_pushed_out_and_is_withdrawn_too_late(
    around: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = around("most_waiting:=1")
    node = graph.start(MessagesByStamp)
    node.is_open = False
    asked = closure(1.0).moments
    monkeypatch.setattr(node, "is_in_flight", lambda key: key == asked)
    graph.send(closure(1.0), closure(2.0))
    graph.wait(lambda: node.accounting.balance().dropped == {"queue_full": 1})
    assert list(node.waiting) == [asked]
    node._keys["its id"] = asked
    node._retract("its id")
    assert by_key(*node.own_diagnostics())["retracted too late"] == 0
    node.note_delivered(asked)
    assert by_key(*node.own_diagnostics())["retracted too late"] == 1
    assert node.accounting.balance().dropped == {"queue_full": 1, "retracted": 1}
