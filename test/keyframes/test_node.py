# SPDX-License-Identifier: Apache-2.0
"""The keyframer: frames in, packed keyframes out, the last one too."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from registration.samples import SECOND, box, frame

from objreg_ros.bridge.messages.keyframes_msg import SentKeyframe, read_keyframe
from objreg_ros.diagnostics import by_key
from objreg_ros.geometry import pose
from objreg_ros.keyframes.node import KeyframerNode
from objreg_ros.memory.compact import unpack_keyframe

CUP = (box("cup", (0, 0, 1)),)
Making = Callable[..., KeyframerNode]


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Making]:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))

    def made(*arguments: str) -> KeyframerNode:
        rclpy.init(args=["keyframer", "--ros-args", "-r", "__ns:=/robot1", *arguments])
        node = KeyframerNode()
        node.frame_of = lambda seen: (seen, None)  # type: ignore[method-assign,assignment]
        return node

    yield made
    rclpy.try_shutdown()


def received(node: KeyframerNode, monkeypatch: pytest.MonkeyPatch) -> list[SentKeyframe]:
    """What is published from now on."""
    sent = list[SentKeyframe]()
    monkeypatch.setattr(node._keyframes, "publish", lambda message: sent.append(read_keyframe(message)))
    return sent


def see(node: KeyframerNode, seconds: int, metres: float) -> bool:
    node.accept(seconds * SECOND)
    seen: Any = frame(seconds, CUP, pose(np.eye(3), np.array([metres, 0.0, 0.0])))
    done = node.compute(seconds * SECOND, seen)
    if done:
        node.accounting.publish(seconds * SECOND)
    return done


def test_what_becomes_a_keyframe_is_sent_packed_with_the_run_of_its_clock(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make()
    sent = received(node, monkeypatch)
    assert [see(node, k, 0.3 * k) for k in range(3)] == [True, False, False]
    node._sender.drain()
    assert [keyframe.stamp_ns for keyframe in sent] == [0, SECOND]
    assert {(keyframe.run, keyframe.began_ns, keyframe.first) for keyframe in sent} == {(node._run, 0, 0)}
    back = unpack_keyframe(sent[1].packed)
    assert back.labels == ("cup",) and back.stamp_ns == SECOND and back.by_odometry
    assert np.allclose(back.T_odom_camera, pose(np.eye(3), np.array([0.3, 0.0, 0.0])))
    stated = by_key(*node.own_diagnostics())
    assert stated["keyframes sent"] == 2 and float(stated["kilobytes a keyframe"]) > 0
    assert node.accounting.balance().published == 3
    node.close()


def test_the_keyframe_in_hand_is_sent_at_the_end(make: Making, monkeypatch: pytest.MonkeyPatch) -> None:
    node = make()
    sent = received(node, monkeypatch)
    see(node, 1, 0.0)
    node.close()
    assert [keyframe.stamp_ns for keyframe in sent] == [SECOND]


def test_a_keyframe_is_thinned_for_the_sake_of_its_size(make: Making, monkeypatch: pytest.MonkeyPatch) -> None:
    node = make("-p", "kilobytes:=10")
    asked = list[int]()

    def pack(keyframe: object, most_bytes: int) -> bytes:
        asked.append(most_bytes)
        return b""

    monkeypatch.setattr("objreg_ros.keyframes.node.pack_keyframe", pack)
    received(node, monkeypatch)
    see(node, 1, 0.0)
    node.close()
    assert asked == [10_000]


def test_the_keyframe_in_hand_is_sent_once_no_frame_came_for_a_while(
    make: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, now = make(), [100.0]
    monkeypatch.setattr("objreg_ros.keyframes.node.time.monotonic", lambda: now[0])
    sent = received(node, monkeypatch)
    see(node, 1, 0.0)
    for seconds in (101.0, 104.9, 105.1, 120.0):
        now[0] = seconds
        node._end_what_rests()
        node._sender.drain()
        assert len(sent) == (seconds > 105.0)
    assert node.accounting.balance().published == 2 and not node.accounting.balance().waiting
    node.close()
