# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bridge.trees import SECOND, moved, panning, said, transform, turned
from objreg_ros.bridge.camera import frames as module
from objreg_ros.bridge.camera.frames import FrameTie, FrameTree, is_world


def test_two_frames_of_one_tree_are_tied_up_and_down() -> None:
    frames = FrameTree()
    frames.add_transforms(said(transform("base", "camera", moved(1)), transform("camera", "camera_optical", moved(2))))
    frames.add_transforms(said(transform("/base", "/imu", moved(3))))
    expected = np.linalg.inv(moved(1) @ moved(2)) @ moved(3)
    T = frames.between("camera_optical", "imu")
    assert T is not None and pytest.approx(expected, abs=1e-9) == T
    assert frames.between("camera", "camera_optical") == pytest.approx(moved(2), abs=1e-9)
    assert frames.between("base", "base") == pytest.approx(np.eye(4))


def test_frames_that_nothing_ties_are_not_guessed() -> None:
    frames = FrameTree()
    frames.add_transforms(said(transform("base", "camera", moved(1)), transform("map", "imu", moved(2))))
    assert frames.between("camera", "imu") is None and frames.between("nowhere", "camera") is None


def test_the_last_transform_of_a_frame_counts_and_a_ring_is_no_end() -> None:
    ring = FrameTree()
    ring.add_transforms(said(transform("a", "b", moved(1)), transform("b", "a", moved(2))))
    assert ring.between("c", "a") is None and ring.between("a", "b") is not None
    frames = FrameTree()
    frames.add_transforms(said(transform("a", "b", moved(1)), transform("a", "b", moved(3))))
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
        frames.add_transforms(said(one))
    assert frames.between("a", "b") is None


@pytest.mark.parametrize("names", [("a", "b" * 1001), ("a" * 1001, "b")])
def test_a_name_that_is_too_long_is_refused(names: tuple[str, str]) -> None:
    frames = FrameTree()
    with pytest.raises(ValueError, match="tf: expected at most 1000 characters, got 1001"):
        frames.add_transforms(said(transform(*names, moved(1))))
    assert frames.between(*names) is None


def test_a_joint_is_followed_between_its_samples() -> None:
    tree = panning(0.0, 10.0, 20.0)
    assert tree.tie("base", "eye") is FrameTie.MOVING and tree.between("base", "eye") is None
    assert tree.between("base", "eye", SECOND + SECOND // 20) == pytest.approx(turned(5.0) @ moved(1), abs=1e-9)
    assert tree.between("base", "eye", SECOND + SECOND // 10) == pytest.approx(turned(10.0) @ moved(1), abs=1e-9)
    assert tree.reached_ns("base", "eye") == SECOND + SECOND // 5


@pytest.mark.parametrize(("beside_ns", "is_known"), [(module.END_NS, True), (module.END_NS + 1, False)])
def test_beside_its_history_a_joint_is_known_for_a_moment_only(beside_ns: int, is_known: bool) -> None:
    tree, last_ns = panning(0.0, 10.0), SECOND + SECOND // 10
    assert (tree.between("base", "eye", last_ns + beside_ns) is not None) is is_known
    assert (tree.between("base", "eye", SECOND - beside_ns) is not None) is is_known


def test_in_a_gap_of_its_samples_a_joint_is_not_guessed() -> None:
    tree = panning(0.0, 10.0, step_ns=module.GAP_NS + 2)
    assert tree.between("base", "eye", SECOND + module.GAP_NS // 2) is None
    assert tree.between("base", "eye", SECOND + 1) == pytest.approx(turned(0.0) @ moved(1), abs=1e-9)


def test_what_tf_repeats_is_as_good_as_static_at_any_moment() -> None:
    tree = panning(7.0, 7.0, 7.0)
    assert tree.tie("base", "eye") is FrameTie.CONSTANT and tree.reached_ns("base", "eye") is None
    for stamp_ns in (None, 0, 1000 * SECOND):
        assert tree.between("base", "eye", stamp_ns) == pytest.approx(turned(7.0) @ moved(1), abs=1e-9)


def test_what_tf_static_says_stays_whatever_tf_says_of_the_same_frames() -> None:
    tree = panning(0.0, 10.0)
    tree.receive_moving(said(transform("head", "eye", moved(5), SECOND)))
    assert tree.tie("head", "eye") is FrameTie.STATIC and tree.between("head", "eye") == pytest.approx(
        moved(1), abs=1e-9
    )


@pytest.mark.parametrize(
    "world", ["odom", "map", "robot1/odom", "odom_combined", "vicon", "camera_odom_frame", "World"]
)
def test_two_bodies_in_one_world_do_not_sit_on_each_other(world: str) -> None:
    tree = FrameTree()
    tree.keep_history("eye", "base")
    for k in range(3):
        tree.receive_moving(
            said(transform(world, "base", moved(k), k * SECOND), transform(world, "eye", moved(9 + k), k))
        )
    assert is_world(world) and tree.between("base", "eye", SECOND) is None and tree.tie("base", "eye") is None
    assert tree.between(world, "eye", 0) is not None


def test_a_frame_that_is_named_as_the_odometrys_carries_nothing_either() -> None:
    tree = FrameTree()
    tree.add_transforms(said(transform("start", "base", moved(1)), transform("start", "eye", moved(2))))
    assert tree.between("base", "eye") is not None
    assert tree.between("base", "eye", None, "start") is None and tree.tie("base", "eye", "start") is None


@pytest.mark.parametrize("name", ["base_link", "mapping_head", "head", "camera_link", "modom", "r1/gripper"])
def test_parts_of_a_robot_are_no_worlds(name: str) -> None:
    assert not is_world(name)


def test_time_that_jumps_back_begins_a_history_anew_and_a_late_sample_is_left_out() -> None:
    tree = panning(0.0, 10.0, start_ns=100 * SECOND)
    tree.receive_moving(said(transform("base", "head", turned(80.0), 100 * SECOND + 1)))
    assert tree.between("base", "eye", 100 * SECOND + 1) == pytest.approx(turned(0.0) @ moved(1), abs=1e-3)
    tree.receive_moving(said(transform("base", "head", turned(40.0), 5 * SECOND)))
    assert tree.between("base", "eye", 5 * SECOND) == pytest.approx(turned(40.0) @ moved(1), abs=1e-9)
    assert tree.between("base", "eye", 100 * SECOND) is None


def test_a_history_is_bounded_in_time_and_in_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_SAMPLES", 5)
    (edges,) = panning(*range(20)).above("head")
    assert len(edges[0].stamps_ns) == len(edges[0].samples) == 5
    monkeypatch.setattr(module, "MOST_SAMPLES", 1000)
    (edges,) = panning(*range(20), step_ns=10 * SECOND).above("head")
    assert len(edges[0].stamps_ns) == module.HISTORY_NS // (10 * SECOND) + 1


def test_of_frames_that_nobody_asked_for_no_history_is_kept_and_their_number_is_bounded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tree = panning(0.0, 10.0)
    for k in range(5):
        tree.receive_moving(said(transform("base", "wheel", turned(k), k * SECOND)))
    ((edge,),) = tree.above("wheel")
    assert len(edge.stamps_ns) == 1
    monkeypatch.setattr(module, "MOST_FRAMES", 4)
    tree.receive_moving(said(transform("base", "arm", moved(1))))
    with pytest.raises(ValueError, match="expected at most 4 frames"):
        tree.receive_moving(said(transform("base", "leg", moved(1))))


def test_one_transform_that_is_none_leaves_the_others_of_its_message() -> None:
    tree, wrong = FrameTree(), transform("a", "b", moved(1))
    wrong.transform.translation.x = float("nan")
    with pytest.raises(ValueError, match="expected b within"):
        tree.receive_moving(said(wrong, transform("a", "c", moved(2))))
    assert tree.between("a", "b") is None and tree.between("a", "c") is not None


def test_a_ring_on_tf_is_no_end() -> None:
    tree = FrameTree()
    tree.keep_history("a")
    for k in range(3):
        tree.receive_moving(
            said(transform("a", "b", moved(k), k), transform("b", "c", moved(k)), transform("c", "a", moved(k)))
        )
    assert tree.between("x", "a", 0) is None and len(tree.above("a")) == 3
