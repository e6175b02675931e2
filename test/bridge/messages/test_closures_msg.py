# SPDX-License-Identifier: Apache-2.0
"""Closures, refusals and landmarks as the messages of objreg_msgs, and back."""

from __future__ import annotations

import re
import uuid
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objreg_ros import limits
from objreg_ros.bridge.messages import closures_msg, headers, layout
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Observation, Reason, Rejected
from objreg_ros.geometry import pose, rotation_from_vector

STAMP = 1_700_000_000_123_456_789
NAMES = {0: "cup", 7: "tv"}
T = pose(rotation_from_vector(np.array([0.1, -2.0, 0.3])), np.array([1.0, 2.0, 3.0]))
CLOSURE = LoopClosure(
    from_ns=5,
    to_ns=STAMP,
    T_from_to=T,
    covariance=np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) + 0.1,
    labels=("cup", "tv"),
    objects=(ObjectMatch(label="cup", object_id=3), ObjectMatch(label="tv", object_id=2**32 - 2)),
    evidence={"score": 0.75, "moved cup [m]": 1.5},
    from_frame_id="front",
    to_frame_id="kinect",
    from_session=0,
    to_session=12,
)
REJECTED = Rejected(
    reason=Reason.TEXTURE,
    from_ns=5,
    to_ns=STAMP,
    detail="0.12 < 0.3",
    T_from_to=T,
    evidence={"texture": 0.12},
    from_frame_id="front",
    to_frame_id="kinect",
    from_session=3,
    to_session=4,
)


OF_ONE = {"from_robot": "robot1", "to_robot": "robot1"}
OF_TWO = {"from_robot": "robot1", "to_robot": "robot2"}


@pytest.fixture
def there() -> None:
    if closures_msg.LoopClosureMsg is None:
        pytest.skip("objreg_msgs is not installed: colcon builds it from this repository")


def assert_same(one: Any, other: Any) -> None:
    """Two values agree in every field, poses to the precision of quaternions."""
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert np.allclose(a, b, rtol=0, atol=1e-12), field.name
        elif field.name == "objects":
            assert [(m.label, m.object_id) for m in a] == [(m.label, m.object_id) for m in b]
        else:
            assert a == b, field.name


@pytest.mark.usefixtures("there")
def test_a_closure_comes_back_with_all_that_is_known_of_it() -> None:
    message = closures_msg.loop_closure(CLOSURE, "robot1")
    assert_same(replace(CLOSURE, **OF_ONE), closures_msg.read_loop_closure(message))
    assert (message.from_moment.robot, message.to_moment.session, message.retracted) == ("robot1", "12", False)
    assert message.header.frame_id == "front" and headers.stamp_ns(message) == STAMP


@pytest.mark.usefixtures("there")
def test_sessions_that_are_not_known_stay_so() -> None:
    closure = replace(CLOSURE, from_session=None, to_session=None)
    assert_same(closure, closures_msg.read_loop_closure(closures_msg.loop_closure(closure)))


@pytest.mark.usefixtures("there")
def test_a_retraction_is_no_closure() -> None:
    message = closures_msg.loop_closure(CLOSURE)
    message.retracted = True
    with pytest.raises(ValueError, match=f"retraction of '{message.id}'"):
        closures_msg.read_loop_closure(message)


@pytest.mark.usefixtures("there")
def test_a_refusal_comes_back_with_its_pose_and_without_one() -> None:
    for rejected in (REJECTED, replace(REJECTED, T_from_to=None, evidence={}, from_frame_id="", from_session=None)):
        message = closures_msg.refusal(rejected, "robot1")
        assert message.has_pose is (rejected.T_from_to is not None)
        assert_same(replace(rejected, **OF_ONE), closures_msg.read_refusal(message))


@pytest.mark.usefixtures("there")
def test_landmarks_come_back_and_those_of_a_label_without_a_number_too() -> None:
    xyz = np.array([0.1, 0.2, 1.5])
    sent = tuple(Observation(label=label, object_id=k, xyz=xyz * k) for k, label in enumerate(("tv", "thing", "dog")))
    message = closures_msg.object_landmarks(sent, STAMP, "kinect", NAMES, 2, "robot1")
    numbers = closures_msg.ObjectLandmark
    assert [item.class_id for item in message.landmarks] == [7, numbers.NO_NAME, numbers.NO_CLASS]
    assert (message.robot, message.session, message.header.frame_id) == ("robot1", "2", "kinect")
    assert not np.any(message.landmarks[0].position_covariance)
    for one, back in zip(sent, closures_msg.read_landmarks(message), strict=True):
        assert (back.label, back.object_id) == (one.label, one.object_id) and np.array_equal(back.xyz, one.xyz)


@pytest.mark.usefixtures("there")
@pytest.mark.parametrize("session", ["kitchen", "-1", "1" * 19, "1\n"])
def test_a_session_that_is_no_number_is_refused_with_what_came(session: str) -> None:
    message = closures_msg.loop_closure(CLOSURE)
    message.from_moment.session = session
    with pytest.raises(ValueError, match="session: expected a number"):
        closures_msg.read_loop_closure(message)


@pytest.mark.usefixtures("there")
def test_more_than_the_limits_allow_is_refused_before_it_is_read() -> None:
    message = closures_msg.loop_closure(CLOSURE)
    message.evidence = [message.evidence[0]] * (limits.MOST_EVIDENCE + 1)
    with pytest.raises(ValueError, match="evidence: expected at most"):
        closures_msg.read_loop_closure(message)
    message = closures_msg.refusal(replace(REJECTED, detail="x" * (limits.MOST_DETAIL + 1)))
    with pytest.raises(ValueError, match="detail: expected at most"):
        closures_msg.read_refusal(message)


@pytest.mark.usefixtures("there")
def test_a_message_without_a_pose_or_with_an_unknown_reason_is_refused() -> None:
    with pytest.raises(ValueError):
        closures_msg.read_loop_closure(closures_msg.LoopClosureMsg())
    with pytest.raises(ValueError, match="nonsense"):
        message = closures_msg.refusal(REJECTED)
        message.reason = "nonsense"
        closures_msg.read_refusal(message)


def test_the_id_of_a_closure_is_that_of_its_moments_and_of_its_robot() -> None:
    first = closures_msg.closure_id(CLOSURE, "robot1")
    assert str(uuid.UUID(first)) == first
    again = replace(CLOSURE, evidence={}, objects=(), T_from_to=np.eye(4))
    assert closures_msg.closure_id(again, "robot1") == first
    others = [replace(CLOSURE, **{name: 77}) for name in ("from_ns", "to_ns", "from_session", "to_session")]
    others += [replace(CLOSURE, from_frame_id="rear"), replace(CLOSURE, to_frame_id="rear")]
    ids = {closures_msg.closure_id(other, "robot1") for other in others} | {closures_msg.closure_id(CLOSURE, "robot2")}
    assert len(ids) == 7 and first not in ids


def test_without_objreg_msgs_nothing_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LoopClosureMsg", "Refusal", "ObjectLandmarks"):
        monkeypatch.setattr(closures_msg, name, None)
    assert closures_msg.loop_closure(CLOSURE) is None and closures_msg.refusal(REJECTED) is None
    assert closures_msg.object_landmarks((), STAMP, "kinect", NAMES) is None


def test_the_message_names_every_reason_there_is(repository: Path) -> None:
    text = (repository / "objreg_msgs/msg/Refusal.msg").read_text()
    named = dict(re.findall(r'^string ([A-Z_]+)="([a-z_]+)"$', text, re.MULTILINE))
    assert named == {reason.name: reason.value for reason in Reason}


def test_the_message_has_the_numbers_that_are_no_class(repository: Path) -> None:
    text = (repository / "objreg_msgs/msg/ObjectLandmark.msg").read_text()
    named = dict(re.findall(r"^uint16 ([A-Z_]+)=(\d+)$", text, re.MULTILINE))
    assert {name: int(value) for name, value in named.items()} == {
        "NO_CLASS": closures_msg.NO_CLASS,
        "NO_NAME": layout.UNNAMED_ID,
    }


@pytest.mark.usefixtures("there")
def test_what_is_of_two_robots_stays_so_whoever_sends_it() -> None:
    between = replace(CLOSURE, **OF_TWO)
    assert_same(between, closures_msg.read_loop_closure(closures_msg.loop_closure(between, "robot3")))
    refused = replace(REJECTED, **OF_TWO)
    assert_same(refused, closures_msg.read_refusal(closures_msg.refusal(refused, "robot3")))


def test_an_id_is_of_the_robots_that_the_closure_names_and_else_of_who_sends_it() -> None:
    first = closures_msg.closure_id(CLOSURE, "robot1")
    assert closures_msg.closure_id(replace(CLOSURE, **OF_ONE), "robot3") == first
    assert closures_msg.closure_id(replace(CLOSURE, **OF_TWO), "robot1") != first
