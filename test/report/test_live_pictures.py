# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.data.images import Detections, Intrinsics
from objreg_ros.geometry import pose
from objreg_tools.report.live_pictures import RIGHT, WRONG, draw_sight, draw_trajectory, write_picture
from objreg_tools.truth import Truth

CAMERA = Intrinsics(fx=100.0, fy=100.0, cx=50.0, cy=40.0, width=100, height=80)


def cloud(xyz: np.ndarray, instance: int) -> ObjectCloud:
    points = np.asarray(xyz, np.float32)
    return ObjectCloud(
        label="cup", score=0.5, instance=instance, xyz=points, normals=np.zeros_like(points), rgb=None,
        flags=np.zeros(len(points), np.uint16), density=1.0,
    )  # fmt: skip


def test_the_points_of_an_object_are_tinted_where_the_camera_sees_them(tmp_path: Path) -> None:
    nothing = np.zeros((0, 4), np.float32)
    seen = Detections(xyxy=nothing, score=nothing[:, 0], label=(), image_hw=(80, 100), stamp_ns=0)
    behind_and_beside = np.array([[0, 0, -1.0], [9.0, 0, 1.0]])
    objects = [cloud(np.array([[0.1, 0.2, 1.0]]), 1), cloud(behind_and_beside, 2)]
    draw_sight(tmp_path / "detections.png", np.full((80, 100, 3), 100, np.uint8), CAMERA, seen, objects)
    changed = np.argwhere((cv2.imread(str(tmp_path / "detections.png")) != 100).any(axis=-1))
    assert changed.tolist() == [[60, 60]]


def test_a_box_is_drawn_with_its_name(tmp_path: Path) -> None:
    box = np.array([[20, 10, 60, 50]], np.float32)
    seen = Detections(xyxy=box, score=np.array([0.5], np.float32), label=("cup",), image_hw=(80, 100), stamp_ns=0)
    draw_sight(tmp_path / "detections.png", np.zeros((80, 100, 3), np.uint8), CAMERA, seen, [])
    picture = cv2.imread(str(tmp_path / "detections.png"))
    assert (picture[50, 20:61] > 100).all() and picture[52:].max() == 0 and picture[14:26, 22:50].max() > 100


def test_a_name_at_the_edge_of_a_picture_is_drawn_whole(tmp_path: Path) -> None:
    widths = []
    for x_min in (5, 80):
        box = np.array([[x_min, 10, 99, 70]], np.float32)
        seen = Detections(xyxy=box, score=np.array([0.5], np.float32), label=("c",), image_hw=(80, 100), stamp_ns=0)
        draw_sight(tmp_path / "detections.png", np.full((80, 100, 3), 100, np.uint8), CAMERA, seen, [])
        black = (cv2.imread(str(tmp_path / "detections.png")) == 0).all(axis=-1)
        widths.append(np.ptp(np.flatnonzero(black.any(axis=0))))
    assert widths[0] == widths[1] > 20


@pytest.mark.parametrize(
    ("name", "expected"),
    [("nowhere/a.png", "expected a place that takes it"), ("a.xyz", r"expected a name like picture\.png")],
)
def test_a_picture_that_cannot_be_written_is_refused(name: str, expected: str, tmp_path: Path) -> None:
    with pytest.raises(OSError, match=expected):
        write_picture(tmp_path / name, np.zeros((4, 4, 3), np.uint8))


def test_a_picture_is_written_in_its_colours(tmp_path: Path) -> None:
    write_picture(tmp_path / "red.png", np.full((4, 4, 3), (255, 0, 0), np.uint8))
    assert cv2.imread(str(tmp_path / "red.png"))[0, 0].tolist() == [0, 0, 255]


def hexadecimal(colour: str) -> np.ndarray:
    return np.array([int(colour[k : k + 2], 16) for k in (5, 3, 1)])


@pytest.mark.parametrize(("x", "colour", "other"), [(1.0, RIGHT, WRONG), (2.0, WRONG, RIGHT)])
def test_a_closure_is_green_where_it_is_true_and_red_where_it_is_false(
    tmp_path: Path, x: float, colour: str, other: str
) -> None:
    truth = Truth([(k, pose(np.eye(3), np.array([k * 0.1, (k % 5) * 0.1, 0.0]))) for k in range(11)])
    T = pose(np.eye(3), np.array([x, 0.0, 0.0]))
    closure = LoopClosure(from_ns=0, to_ns=10, T_from_to=T, covariance=np.eye(6), labels=())
    draw_trajectory(tmp_path / "trajectory.png", truth, [closure])
    picture = cv2.imread(str(tmp_path / "trajectory.png"))
    near = [int((np.abs(picture.astype(int) - hexadecimal(c)).max(axis=-1) < 10).sum()) for c in (colour, other)]
    assert near[0] > 50 and near[1] == 0


def test_a_way_without_truth_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="ground truth"):
        draw_trajectory(tmp_path / "trajectory.png", Truth([]), [])


def test_where_there_is_no_matplotlib_the_error_says_what_brings_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'objreg_ros\[report\]'"):
        draw_trajectory(tmp_path / "trajectory.png", Truth([(0, np.eye(4)), (1, np.eye(4))]), [])
