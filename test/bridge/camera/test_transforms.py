# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.bridge.camera import transforms
from objreg_ros.bridge.camera.transforms import receive_frames, receive_mount
from objreg_ros.data.frames import Odometry


class Listener:
    """Stands in for a node, and remembers to what it listens and what it says."""

    def __init__(self) -> None:
        self.received: dict[str, Any] = {}
        self.said: list[str] = []

    def listen(self, kind: Any, topic: str, received: Any, profile: Any) -> None:
        self.received[topic] = received

    def get_logger(self) -> Any:
        return SimpleNamespace(info=self.said.append)


def eye_on_base() -> Any:
    place, turn = SimpleNamespace(x=0.1, y=0.0, z=0.4), SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    transform = SimpleNamespace(translation=place, rotation=turn)
    header = SimpleNamespace(frame_id="base")
    return SimpleNamespace(transforms=[SimpleNamespace(header=header, child_frame_id="eye", transform=transform)])


ODOMETRY = [Odometry(T_odom_body=np.eye(4), child_frame_id="base", stamp_ns=1, frame_id="odom")]


def test_where_the_type_is_installed_tf_static_is_received_and_says_where_the_camera_sits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(transforms, "TFMessage", object)
    node: Any = Listener()
    mount = receive_mount(node, None)
    node.received["/tf_static"](eye_on_base())
    T = mount.T_body_camera(ODOMETRY, "eye")
    assert T is not None and T[:3, 3].tolist() == [0.1, 0.0, 0.4] and "at 0.100 0.000 0.400 m" in node.said[0]


def test_where_the_type_is_missing_or_a_parameter_is_set_nothing_is_received(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transforms, "TFMessage", object)
    node: Any = Listener()
    mount = np.eye(4)
    assert receive_mount(node, mount).T_body_camera(ODOMETRY, "eye") is mount
    monkeypatch.setattr(transforms, "TFMessage", None)
    assert receive_frames(node).between("base", "eye") is None
    assert node.received == {} and node.said == []


def test_the_real_message_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = pytest.importorskip("tf2_msgs.msg", reason="tf2_msgs is not installed")
    stamped = pytest.importorskip("geometry_msgs.msg").TransformStamped
    one = stamped(child_frame_id="eye")
    one.header.frame_id, one.transform.translation.x = "base", 0.5
    node: Any = Listener()
    frames = receive_frames(node)
    node.received["/tf_static"](kinds.TFMessage(transforms=[one]))
    T = frames.between("base", "eye")
    assert T is not None and T[0, 3] == 0.5
