# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_ros.bridge.messages import from_msg, motion_from_msg
from objreg_tools.recording import open_recording
from objreg_tools.recording.folders.stray_scanner import NEAR, Video

HEADER = "timestamp, frame, x, y, z, qx, qy, qz, qw"


def video(file: Path, frames: int, size: tuple[int, int] = (128, 96)) -> Path:
    """A video whose frame i is of grey 20 i."""
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"mp4v"), 30, size)
    for i in range(frames):
        writer.write(np.full((size[1], size[0], 3), 20 * (i % 12), np.uint8))
    writer.release()
    return file


def scan(path: Path, frames: int = 5) -> Path:
    """A scan with a video of twice the pixels of depth; the device climbs 0.1 m a frame, level, looking along -z."""
    (path / "depth").mkdir(parents=True)
    video(path / "rgb.mp4", frames)
    rows = [HEADER]
    for i in range(frames):
        cv2.imwrite(str(path / f"depth/{i:06d}.png"), np.full((48, 64), 1000 + i, np.uint16))
        rows.append(f"{100 + i / 30}, {i:06d}, 0.0, {0.1 * i}, 0.0, 1.0, 0.0, 0.0, 0.0")
    (path / "odometry.csv").write_text("\n".join(rows) + "\n")
    (path / "camera_matrix.csv").write_text("100.0,0.0,63.5\n0.0,100.0,47.5\n0.0,0.0,1.0\n")
    return path


def test_a_scan_is_colour_in_the_size_of_depth_with_its_camera(tmp_path: Path) -> None:
    with open_recording(scan(tmp_path)) as recording:
        assert recording.kind == "Stray Scanner folder"
        assert {name: topic.count for name, topic in recording.topics.items()} == dict.fromkeys(
            ("/camera_info", "/odom", "/image", "/depth/image"), 5
        )
        first = {r.topic: r.message for r in recording.records(end_ns=100 * 10**9 + 1)}
        seen = from_msg.depth_image(first["/depth/image"], first["/camera_info"], first["/image"])
        assert seen.rgb is not None and seen.rgb.shape == (48, 64, 3) and seen.depth[0, 0] == 1
        assert (seen.intrinsics.fx, seen.intrinsics.cx, seen.intrinsics.cy) == (50, 31.5, 23.5)
        greys = [int(from_msg.image(r.message).rgb[24, 32, 0]) for r in recording.records(["/image"])]
        assert greys == pytest.approx([0, 20, 40, 60, 80], abs=6)
    assert "camera_matrix.csv is of pictures of 128 × 96: scaled to depth's 64 × 48" in recording.notes


def test_odometry_is_of_the_camera_in_a_frame_whose_z_is_up(tmp_path: Path) -> None:
    with open_recording(scan(tmp_path)) as recording:
        poses = [motion_from_msg.odometry(r.message) for r in recording.records(["/odom"])]
    assert {(pose.frame_id, pose.child_frame_id) for pose in poses} == {("odom", "camera")}
    assert [pose.T_odom_body[2, 3] for pose in poses] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4], abs=1e-6)
    x, down, forward = poses[0].T_odom_body[:3, :3].T
    assert np.allclose(down, (0, 0, -1)) and np.allclose(forward, (0, 1, 0)) and np.allclose(x, (1, 0, 0))


@pytest.mark.parametrize("name", ["rgb.mp4", "camera_matrix.csv", "depth"])
def test_a_part_that_is_missing_is_named(name: str, tmp_path: Path) -> None:
    folder = scan(tmp_path / "scan")
    (folder / name).rename(tmp_path / name)
    with pytest.raises(
        FileNotFoundError, match=rf"expected rgb\.mp4, depth/, .* got .*, without {name}; copy the whole"
    ):
        open_recording(folder)


def test_frames_without_depth_are_left_out_and_counted(tmp_path: Path) -> None:
    folder = scan(tmp_path)
    (folder / "depth/000002.png").unlink()
    with open_recording(folder) as recording:
        assert recording.topics["/image"].count == 4
        assert "1 frames have no depth or no pose and are left out" in recording.notes
        greys = [int(from_msg.image(r.message).rgb[24, 32, 0]) for r in recording.records(["/image"])]
    assert greys == pytest.approx([0, 20, 60, 80], abs=6)


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [("odometry.csv", HEADER, "expected rows of odometry.csv with pictures of their frames in depth/, got 0 rows"),
     ("odometry.csv", f"{HEADER}\n1.0, 000000, a, 0, 0, 0, 0, 0, 1", "expected timestamp, frame, x, y, z"),
     ("odometry.csv", f"{HEADER}\n1.0, zero, 0, 0, 0, 0, 0, 0, 1", "expected timestamp, frame, x, y, z"),
     ("rgb.mp4", "no video", "expected a video, got a file that OpenCV does not open")],
)  # fmt: skip
def test_a_broken_part_is_refused_by_name(file: str, text: str, said: str, tmp_path: Path) -> None:
    (scan(tmp_path) / file).write_text(text)
    with pytest.raises(ValueError, match=said):
        open_recording(tmp_path)


def test_frames_of_a_video_may_be_asked_for_in_any_order(tmp_path: Path) -> None:
    opened = Video(video(tmp_path / "a.mp4", 12))
    for number in (3, 4, 9, 0, 11, 5):
        assert int(opened.frame(number)[48, 64, 0]) == pytest.approx(20 * number, abs=6)
    for _ in range(2):
        with pytest.raises(ValueError, match=r"a\.mp4: expected frame 40, got a video that ends"):
            opened.frame(40)
    assert int(opened.frame(1)[48, 64, 0]) == pytest.approx(20, abs=6) and NEAR > 40
    opened.close()
