# SPDX-License-Identifier: Apache-2.0
"""Closures are received once each, whatever topics they come on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.bridge.messages import closures_msg, to_msg
from objreg_ros.bridge.streams.closures_in import ClosuresIn
from objreg_ros.data.closures import LoopClosure

CLOSURE = LoopClosure(from_ns=5, to_ns=9, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",), to_session=1)


class Receiver:
    """Stands in for a node, keeps what it receives, and is given messages by topic."""

    def __init__(self, topic: str = "auto", robots: tuple[str, ...] = ()) -> None:
        self.received: dict[str, Callable[[Any], None]] = {}
        self.taken: list[LoopClosure] = []
        self.again: list[LoopClosure] = []
        self.withdrawn: list[Any] = []
        self.dropped: list[str] = []
        prefixes = {robot: f"{robot}/" for robot in robots}
        callbacks = self.taken.append, self.again.append, lambda *withdrawn: self.withdrawn.append(withdrawn)
        self.closures = ClosuresIn(self, topic, *callbacks, prefixes)  # type: ignore[arg-type]

    def listen(self, kind: type, topic: str, received: Callable[[Any], None], profile: Any) -> None:
        self.received[topic] = received

    def read_aside(self, topic: str, decode: Callable[[Any], LoopClosure], message: Any) -> LoopClosure | None:
        try:
            return decode(message)
        except ValueError:
            return None

    def accept(self, stamp_ns: int) -> None:
        pass

    def drop(self, stamp_ns: int, reason: str) -> None:
        self.dropped.append(reason)


@pytest.fixture(autouse=True)
def _messages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The messages of `whole` are as good as those of objreg_msgs, which need not be installed."""
    monkeypatch.setattr(closures_msg, "LoopClosureMsg", SimpleNamespace)


def whole(closure: LoopClosure, robot: str) -> SimpleNamespace:
    ends = {
        end: SimpleNamespace(stamp=to_msg.stamp(stamp_ns), frame_id="camera", robot=robot, session="")
        for end, stamp_ns in (("from_moment", closure.from_ns), ("to_moment", closure.to_ns))
    }
    pose = to_msg.constraint(closure).pose
    name = closures_msg.closure_id(closure, robot)
    header = to_msg.header(closure.to_ns, "camera")
    return SimpleNamespace(
        header=header, id=name, retracted=False, labels=["cup"], objects=[], evidence=[], pose=pose, **ends
    )


def test_what_comes_on_both_topics_is_taken_once_whichever_names_the_robot() -> None:
    for whole_first in (True, False):
        receiver = Receiver()
        messages = [("loop_closures", whole(CLOSURE, "x")), ("constraints", to_msg.constraint(CLOSURE))]
        for topic, message in messages if whole_first else messages[::-1]:
            receiver.received[topic](message)
        assert (len(receiver.taken), len(receiver.again)) == (1, 1)


def test_equal_moments_of_two_robots_are_two_closures_and_one_is_taken_back() -> None:
    receiver = Receiver()
    messages = [whole(CLOSURE, robot) for robot in ("a", "b", "a")]
    for message in messages:
        receiver.received["loop_closures"](message)
    assert [closure.robots for closure in receiver.taken] == [("a", "a"), ("b", "b")] and len(receiver.again) == 1
    messages[1].retracted = True
    receiver.received["loop_closures"](messages[1])
    assert receiver.withdrawn == [(CLOSURE.moments, ("b", "b"))]
    receiver.closures.forget_closure(receiver.taken[0])
    receiver.received["loop_closures"](messages[0])
    assert [closure.robots for closure in receiver.taken[2:]] == [("a", "a")]


def test_what_was_taken_back_is_taken_again_when_its_id_comes_again() -> None:
    receiver, message = Receiver(), whole(CLOSURE, "a")
    for retracted in (False, True, False, False, True, False):
        message.retracted = retracted
        receiver.received["loop_closures"](message)
        receiver.received["constraints"](to_msg.constraint(CLOSURE))
    assert len(receiver.taken) == 3 and len(receiver.withdrawn) == 2


def test_what_was_known_before_a_restart_is_taken_back_by_its_id() -> None:
    receiver, message = Receiver(), whole(CLOSURE, "a")
    receiver.closures.know([replace(CLOSURE, from_robot="a", to_robot="a")])
    message.id = closures_msg.closure_id(replace(CLOSURE, from_robot="a", to_robot="a"))
    message.retracted = True
    receiver.received["loop_closures"](message)
    assert receiver.withdrawn == [(CLOSURE.moments, ("a", "a"))]


def test_the_topic_of_a_robot_names_it() -> None:
    receiver = Receiver("constraints", ("a", "b"))
    assert set(receiver.received) == {"constraints", "a/constraints", "b/constraints"}
    for topic in receiver.received:
        receiver.received[topic](to_msg.constraint(replace(CLOSURE, to_ns=len(topic))))
    assert [closure.robots for closure in receiver.taken] == [("", ""), ("a", "a"), ("b", "b")]


def test_what_is_no_constraint_is_dropped_as_malformed() -> None:
    receiver, message = Receiver("constraints"), to_msg.constraint(CLOSURE)
    message.header.frame_id = "camera"
    receiver.received["constraints"](message)
    assert receiver.dropped == ["malformed_constraints"] and not receiver.taken


def test_on_constraints_the_prefixes_of_frames_name_the_robots_and_both_topics_carry_one_closure() -> None:
    between = replace(
        CLOSURE, from_robot="r1", to_robot="r2", from_frame_id="r1/camera", to_frame_id="r2/camera", to_session=None
    )
    receiver = Receiver(robots=("r1", "r2"))
    receiver.received["constraints"](to_msg.constraint(between))
    (closure,) = receiver.taken
    assert closure.robots == ("r1", "r2") and closure.moments == between.moments
    message = whole(between, "")
    for end, robot in ((message.from_moment, "r1"), (message.to_moment, "r2")):
        end.robot, end.frame_id = robot, f"{robot}/camera"
    receiver.received["loop_closures"](message)
    assert len(receiver.taken) == 1 and len(receiver.again) == 1


def test_a_frame_without_a_prefix_is_of_the_robot_whose_topic_carries_it() -> None:
    receiver = Receiver(robots=("r1", "r2"))
    receiver.received["r2/constraints"](to_msg.constraint(CLOSURE))
    assert receiver.taken[0].robots == ("r2", "r2")


@pytest.mark.parametrize("topic", ["e/constraints", "e/loop_closures"])
def test_nobody_speaks_for_others_on_a_topic_of_its_own(topic: str) -> None:
    receiver = Receiver(robots=("a", "b", "e"))
    forged = replace(CLOSURE, from_robot="a", to_robot="b", from_frame_id="a/camera", to_frame_id="b/camera")
    message = to_msg.constraint(forged)
    if topic.endswith("loop_closures"):
        message = whole(forged, "")
        message.from_moment.robot, message.to_moment.robot = "a", "b"
    receiver.received[topic](message)
    assert receiver.dropped == [f"malformed_{topic[2:]}"] and not receiver.taken


def test_a_closure_whose_frame_has_the_prefix_of_another_robot_is_refused() -> None:
    receiver = Receiver(robots=("a", "b", "e"))
    message = whole(CLOSURE, "e")
    for end in (message.from_moment, message.to_moment):
        end.frame_id = "b/camera"
    for topic in ("loop_closures", "e/loop_closures"):
        receiver.received[topic](message)
    assert receiver.dropped == ["malformed_loop_closures"] * 2 and not receiver.taken


def test_a_closure_of_a_robot_and_another_is_taken_on_the_topic_of_either() -> None:
    receiver = Receiver("constraints", ("a", "b"))
    for to_ns, topic in ((9, "a/constraints"), (10, "b/constraints"), (11, "constraints")):
        between = replace(CLOSURE, to_ns=to_ns, from_frame_id="a/camera", to_frame_id="b/camera")
        receiver.received[topic](to_msg.constraint(between))
    assert [closure.robots for closure in receiver.taken] == [("a", "b")] * 3


def test_a_robot_takes_back_on_its_topic_no_closure_of_others() -> None:
    receiver = Receiver(robots=("a", "e"))
    message = whole(CLOSURE, "a")
    receiver.received["loop_closures"](message)
    message.retracted = True
    receiver.received["e/loop_closures"](message)
    assert receiver.withdrawn == []
    receiver.received["a/loop_closures"](message)
    assert receiver.withdrawn == [(CLOSURE.moments, ("a", "a"))]
