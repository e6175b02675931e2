# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.bridge.frames import FrameTree
from objreg_ros.geometry import pose, quaternion_from_rotation, rotation_from_vector


def transform(parent: str, child: str, T: np.ndarray) -> Any:
    x, y, z, w = quaternion_from_rotation(T[:3, :3])
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(x=T[0, 3], y=T[1, 3], z=T[2, 3]), rotation=SimpleNamespace(x=x, y=y, z=z, w=w)
        ),
    )


def moved(k: int) -> np.ndarray:
    rng = np.random.default_rng(k)
    return pose(rotation_from_vector(rng.normal(0, 1, 3)), rng.normal(0, 1, 3))


def said(*transforms: Any) -> Any:
    return SimpleNamespace(transforms=list(transforms))


def test_two_frames_of_one_tree_are_tied_up_and_down() -> None:
    frames = FrameTree()
    frames.hear(said(transform("base", "camera", moved(1)), transform("camera", "camera_optical", moved(2))))
    frames.hear(said(transform("/base", "/imu", moved(3))))
    expected = np.linalg.inv(moved(1) @ moved(2)) @ moved(3)
    T = frames.between("camera_optical", "imu")
    assert T is not None and pytest.approx(expected, abs=1e-9) == T
    assert frames.between("camera", "camera_optical") == pytest.approx(moved(2), abs=1e-9)
    assert frames.between("base", "base") == pytest.approx(np.eye(4))


def test_frames_that_nothing_ties_are_not_guessed() -> None:
    frames = FrameTree()
    frames.hear(said(transform("base", "camera", moved(1)), transform("map", "imu", moved(2))))
    assert frames.between("camera", "imu") is None and frames.between("nowhere", "camera") is None


def test_the_last_word_on_a_frame_counts_and_a_ring_is_no_end() -> None:
    ring = FrameTree()
    ring.hear(said(transform("a", "b", moved(1)), transform("b", "a", moved(2))))
    assert ring.between("c", "a") is None and ring.between("a", "b") is not None
    frames = FrameTree()
    frames.hear(said(transform("a", "b", moved(1)), transform("a", "b", moved(3))))
    assert frames.between("a", "b") == pytest.approx(moved(3), abs=1e-9)


@pytest.mark.parametrize("wrong", ["rotation", "translation"])
def test_a_transform_that_is_none_is_refused(wrong: str) -> None:
    one = transform("a", "b", moved(1))
    if wrong == "rotation":
        one.transform.rotation = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)
    else:
        one.transform.translation.x = float("nan")
    frames = FrameTree()
    with pytest.raises(ValueError, match="expected"):
        frames.hear(said(one))
    assert frames.between("a", "b") is None


@pytest.mark.parametrize("names", [("a", "b" * 1001), ("a" * 1001, "b")])
def test_a_name_that_is_too_long_is_refused(names: tuple[str, str]) -> None:
    frames = FrameTree()
    with pytest.raises(ValueError, match="tf: expected at most 1000 characters, got 1001"):
        frames.hear(said(transform(*names, moved(1))))
    assert frames.between(*names) is None
