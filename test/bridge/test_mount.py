# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.bridge.frames import FrameTree
from objreg_ros.bridge.mount import Body, Mount, Seat, nameless_body
from objreg_ros.data import Odometry

from .test_frames import moved, said, transform


def words(child: str) -> list[Odometry]:
    return [Odometry(T_odom_body=np.eye(4), child_frame_id=child, stamp_ns=1, frame_id="odom")]


def test_the_camera_sits_on_the_body_as_the_parameter_says_else_as_the_tree_does() -> None:
    frames, said_of_it = FrameTree(), list[str]()
    frames.hear(said(transform("base", "eye", moved(1))))
    mount = Mount(None, frames, said_of_it.append)
    for _ in range(3):
        assert mount.T_body_camera(words("/base"), "eye") == pytest.approx(moved(1), abs=1e-9)
    (text,) = said_of_it
    assert text.startswith("/tf_static has the camera's 'eye' on the odometry's 'base' at ")
    assert Mount(moved(2), frames, said_of_it.append).T_body_camera(words("base"), "eye") is not None
    assert np.array_equal(Mount(moved(2), frames).T_body_camera(words("base"), "eye"), moved(2))
    assert len(said_of_it) == 1


def test_what_nothing_ties_is_one_place_and_said_once_and_again_where_that_changes() -> None:
    frames, said_of_it = FrameTree(), list[str]()
    mount = Mount(None, frames, said_of_it.append)
    assert [mount.T_body_camera(words("base"), "eye") for _ in range(3)] == [None] * 3
    (text,) = said_of_it
    assert "ties the odometry's 'base' to the camera's 'eye': taken to be one place; set T_base_camera" in text
    frames.hear(said(transform("base", "eye", moved(1))))
    assert mount.T_body_camera(words("base"), "eye") is not None and len(said_of_it) == 2


@pytest.mark.parametrize("told", [None, [], "eye", "/eye"])
def test_odometry_of_the_camera_itself_and_none_need_no_word(told: object) -> None:
    said_of_it = list[str]()
    mount = Mount(None, FrameTree(), said_of_it.append)
    assert mount.T_body_camera(words(told) if isinstance(told, str) else told, "eye") is None  # type: ignore[arg-type]
    assert said_of_it == []


def test_what_is_assumed_of_two_robots_in_turn_is_said_once_of_each() -> None:
    texts: list[str] = []
    mount = Mount(None, FrameTree(), texts.append)
    for robot in ("a", "b") * 3:
        word = Odometry(T_odom_body=np.eye(4), stamp_ns=0, child_frame_id=f"{robot}/base")
        mount.T_body_camera([word], f"{robot}/camera")
    assert len(texts) == 2 and "a/base" in texts[0] and "b/base" in texts[1]
