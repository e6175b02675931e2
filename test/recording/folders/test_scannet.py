# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_ros.bridge.messages import camera_from_msg, from_msg, motion_from_msg
from objreg_tools.recording import open_recording


def scene(path: Path, frames: int = 12, colour: tuple[int, int] = (81, 61), depth: tuple[int, int] = (40, 30)) -> Path:
    """A scene whose colour has about twice the pixels of depth; frame i is i tenths of a metre along x, 1 m away."""
    for name in ("color", "depth", "pose", "intrinsic"):
        (path / name).mkdir(parents=True)
    for i in range(frames):
        cv2.imwrite(str(path / f"color/{i}.jpg"), np.full((colour[1], colour[0], 3), 10 * i, np.uint8))
        cv2.imwrite(str(path / f"depth/{i}.png"), np.full((depth[1], depth[0]), 1000, np.uint16))
        T = np.eye(4)
        T[0, 3] = 0.1 * i
        np.savetxt(path / f"pose/{i}.txt", T, fmt="%.6f")
    np.savetxt(path / "intrinsic/intrinsic_depth.txt", [[35, 0, 19.5, 0], [0, 35, 14.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    return path


def test_a_scene_is_colour_depth_and_truth_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    recording = open_recording(scene(tmp_path))
    assert recording.kind == "ScanNet folder" and recording.of_pictures
    assert {name: topic.count for name, topic in recording.topics.items()} == dict.fromkeys(
        ("/camera_info", "/ground_truth", "/image", "/depth/image"), 12
    )
    greys = [int(from_msg.image(r.message).rgb[0, 0, 0]) for r in recording.records(["/image"])]
    assert greys == pytest.approx([10 * i for i in range(12)], abs=2)
    poses = [motion_from_msg.odometry(r.message).T_odom_body[0, 3] for r in recording.records(["/ground_truth"])]
    assert poses == pytest.approx([0.1 * i for i in range(12)])
    assert "times are the numbers of frames: each is taken for a second" in recording.notes


def test_colour_comes_in_the_size_of_depth(tmp_path: Path) -> None:
    first = {r.topic: r.message for r in open_recording(scene(tmp_path)).records(end_ns=1)}
    seen = from_msg.depth_image(first["/depth/image"], first["/camera_info"], first["/image"])
    assert seen.rgb is not None and seen.rgb.shape == (30, 40, 3) and seen.depth[0, 0] == 1
    assert (seen.intrinsics.fx, seen.intrinsics.cx) == (35, 19.5)


def test_a_camera_of_colour_is_scaled_to_depth(tmp_path: Path) -> None:
    folder = scene(tmp_path, colour=(80, 60))
    (folder / "intrinsic/intrinsic_depth.txt").unlink()
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", [[70, 0, 39.5], [0, 70, 29.5], [0, 0, 1]])
    recording = open_recording(folder)
    camera = camera_from_msg.intrinsics(next(recording.records(["/camera_info"])).message)
    assert (camera.fx, camera.cx, camera.cy, camera.width) == (35, 19.5, 14.5, 40)
    assert "intrinsic/intrinsic_color.txt is of pictures of 80 × 60: scaled to depth's 40 × 30" in recording.notes


def test_a_pose_that_was_lost_is_passed_over(tmp_path: Path) -> None:
    folder = scene(tmp_path)
    np.savetxt(folder / "pose/3.txt", np.full((4, 4), -np.inf))
    recording = open_recording(folder)
    assert recording.topics["/ground_truth"].count == 11
    assert any("1 of 12 poses of pose/ are none" in note for note in recording.notes)


def test_pictures_without_a_partner_are_counted(tmp_path: Path) -> None:
    folder = scene(tmp_path)
    (folder / "depth/5.png").unlink()
    recording = open_recording(folder)
    assert recording.topics["/image"].count == 11
    assert "1 pictures have no partner of their number and are left out" in recording.notes


@pytest.mark.parametrize(
    ("gone", "said"),
    [("color", r"pictures of one number in color/ and depth/, got 0 and 12"),
     ("intrinsic", r"expected intrinsic_depth\.txt or intrinsic_color\.txt, got nothing")],
)  # fmt: skip
def test_a_part_that_is_missing_is_named(gone: str, said: str, tmp_path: Path) -> None:
    folder = scene(tmp_path)
    (folder / gone).rename(tmp_path.parent / f"{tmp_path.name}_{gone}")
    with pytest.raises(FileNotFoundError, match=said):
        open_recording(folder)


def test_a_pose_of_other_numbers_is_refused_by_name(tmp_path: Path) -> None:
    (scene(tmp_path) / "pose/2.txt").write_text("1 2 3")
    with pytest.raises(ValueError, match=r"pose/2\.txt: expected 4 × 4 numbers, got '1 2 3'"):
        open_recording(tmp_path)
