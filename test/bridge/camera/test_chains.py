# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from bridge.trees import SECOND, moved, said, transform, turned
from objreg_ros.bridge.camera.chains import body_of, names_of, odometry_edge, truth_edge
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.geometry import pose

STATIC, TRAVELS, TURNS, REPEATS = "static", "travels", "turns", "repeats"


def at(k: int, how: str) -> np.ndarray:
    if how == TRAVELS:
        return pose(np.eye(3), np.array([0.3 * k, 0.0, 0.0]))
    return turned(5.0 * k) if how == TURNS else moved(1)


def tree_of(*edges: tuple[str, str, str]) -> FrameTree:
    """Frames in their parents, each as it moves, with ``eye`` followed."""
    tree = FrameTree()
    tree.keep_history("eye")
    for parent, child, how in edges:
        if how == STATIC:
            tree.add_transforms(said(transform(parent, child, moved(1))))
    for k in range(4):
        moving = [transform(p, c, at(k, how), k * SECOND) for p, c, how in edges if how != STATIC]
        tree.receive_moving(said(*moving))
    return tree


@pytest.mark.parametrize(
    ("edges", "expected"),
    [
        ([("odom", "base_link", TRAVELS), ("base_link", "eye", STATIC)], "odom → base_link"),
        ([("r1/odom", "r1/base", REPEATS), ("r1/base", "eye", REPEATS)], "r1/odom → r1/base"),
        ([("map", "odom", TRAVELS), ("odom", "foot", TRAVELS), ("foot", "eye", STATIC)], "odom → foot"),
        ([("odom", "base", TRAVELS), ("base", "head", TURNS), ("head", "eye", STATIC)], "odom → base"),
        ([("start", "base", TRAVELS), ("base", "eye", STATIC)], "start → base"),
        ([("odom", "eye", TRAVELS)], "odom → eye"),
        ([("vicon", "base", TRAVELS), ("odom", "base", TRAVELS), ("base", "eye", STATIC)], "odom → base"),
        ([("base_link", "head", TURNS), ("head", "eye", STATIC)], None),
        ([("base_link", "lift", TRAVELS), ("lift", "eye", STATIC)], None),
        ([("arm", "hand", TURNS), ("hand", "eye", STATIC)], None),
        ([("base_link", "arm", STATIC), ("arm", "lift", TRAVELS), ("lift", "eye", STATIC)], None),
        ([("world", "eye", TRAVELS)], None),
        ([("map", "base", TRAVELS), ("base", "eye", STATIC)], None),
        ([("odom", "base", TRAVELS)], None),
    ],
)
def test_the_odometry_above_a_camera_is_found_by_name_or_by_its_travel(
    edges: list[tuple[str, str, str]], expected: str | None
) -> None:
    edge = odometry_edge(tree_of(*edges), "eye")
    assert (None if edge is None else names_of(edge)) == expected


def test_a_map_is_odometry_only_where_it_is_asked_for() -> None:
    tree = tree_of(("map", "base", TRAVELS), ("base", "eye", STATIC))
    edge = odometry_edge(tree, "eye", outright=True)
    assert edge is not None and names_of(edge) == "map → base"


@pytest.mark.parametrize(
    ("edges", "expected"),
    [
        ([("world", "kinect", TRAVELS), ("kinect", "eye", REPEATS)], "world → kinect"),
        ([("mocap", "base", TRAVELS), ("odom", "base", TRAVELS), ("base", "eye", STATIC)], "mocap → base"),
        ([("world", "eye", TRAVELS), ("odom", "base", TRAVELS), ("base", "eye", STATIC)], "world → eye"),
        ([("map", "odom", TRAVELS), ("odom", "base", TRAVELS), ("base", "eye", STATIC)], None),
        ([("world", "eye", REPEATS)], None),
        ([("odom", "eye", TRAVELS)], None),
    ],
)
def test_the_truth_above_a_camera_is_what_moves_in_a_world(
    edges: list[tuple[str, str, str]], expected: str | None
) -> None:
    edge = truth_edge(tree_of(*edges), "eye")
    assert (None if edge is None else names_of(edge)) == expected


@pytest.mark.parametrize(
    ("odom", "edges", "expected"),
    [
        ("odom", [("odom", "base", TRAVELS), ("base", "eye", STATIC)], "base"),
        ("map", [("map", "odom", REPEATS), ("odom", "base", TRAVELS), ("base", "eye", STATIC)], "base"),
        ("odom", [("odom", "foot", REPEATS), ("foot", "base_link", STATIC), ("base_link", "eye", STATIC)], "foot"),
        ("odom", [("odom", "base", REPEATS), ("base", "head", TURNS), ("head", "eye", STATIC)], "base"),
        ("odom", [("base_link", "mast", STATIC), ("mast", "eye", STATIC)], "base_link"),
        ("odom", [("r1/base_link", "eye", STATIC)], "r1/base_link"),
        ("odom", [("mast", "eye", STATIC)], ""),
        ("odom", [("body", "base_link", STATIC), ("base_link", "eye", STATIC)], ""),
    ],
)
def test_odometry_without_a_child_is_of_the_frame_by_which_the_camera_hangs_or_of_the_only_base(
    odom: str, edges: list[tuple[str, str, str]], expected: str
) -> None:
    assert body_of(tree_of(*edges), odom, "eye") == expected


def test_two_bases_straight_above_each_other_are_one_to_odometry() -> None:
    tree = tree_of(("base_link", "eye", STATIC))
    tree.add_transforms(said(transform("base_footprint", "base_link", pose(np.eye(3), np.array([0.0, 0.0, 0.07])))))
    assert body_of(tree, "odom", "eye") == "base_link"
