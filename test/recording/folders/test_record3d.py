# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from objreg_ros.bridge.messages import from_msg, motion_from_msg
from objreg_tools.recording import open_recording
from objreg_tools.recording.folders import record3d

METADATA = {
    "w": 48, "h": 64, "dw": 24, "dh": 32, "fps": 10, "K": [50, 0, 0, 0, 50, 0, 23.5, 31.5, 1],
    "poses": [[0, 0, 0, 1, 0, 0.1 * i, 0] for i in range(3)],
}  # fmt: skip


def folder(path: Path, frames: int = 3, **changes: Any) -> Path:
    """An exported folder with depth of numpy; the device climbs 0.1 m a frame and looks along -z."""
    for name in ("rgb", "depth"):
        (path / name).mkdir(parents=True)
    (path / "metadata").write_text(json.dumps({**METADATA, **changes}))
    for i in range(frames):
        cv2.imwrite(str(path / f"rgb/{i}.jpg"), np.full((64, 48, 3), 20 * i, np.uint8))
        metres = np.full((32, 24), 1 + i, np.float32)
        metres[0, 0] = np.nan
        np.save(path / f"depth/{i}.npy", metres)
    return path


def packed(path: Path) -> Path:
    """The same as an .r3d file."""
    of = folder(path / "folder")
    with zipfile.ZipFile(path / "a.r3d", "w") as archive:
        for file in sorted(of.rglob("*")):
            archive.write(file, file.relative_to(of))
    return path / "a.r3d"


@pytest.mark.parametrize("make", [folder, packed])
def test_a_recording_is_colour_in_the_size_of_depth_with_its_camera(make: Any, tmp_path: Path) -> None:
    with open_recording(make(tmp_path)) as recording:
        assert recording.kind == "Record3D recording" and recording.of_pictures
        assert {name: topic.count for name, topic in recording.topics.items()} == dict.fromkeys(
            ("/camera_info", "/odom", "/image", "/depth/image"), 3
        )
        assert [r.stamp_ns for r in recording.records(["/image"])] == [0, 10**8, 2 * 10**8]
        first = {r.topic: r.message for r in recording.records(end_ns=1)}
        seen = from_msg.depth_image(first["/depth/image"], first["/camera_info"], first["/image"])
        assert seen.rgb is not None and seen.rgb.shape == (32, 24, 3)
        assert (seen.intrinsics.fx, seen.intrinsics.cx, seen.intrinsics.cy) == (25, 11.5, 15.5)
        assert seen.depth[5, 5] == 1 and seen.depth[0, 0] == 0
        assert "no times of frames: 10 a second by metadata" in recording.notes


def test_odometry_is_of_the_optical_frame_where_z_is_up(tmp_path: Path) -> None:
    poses = [motion_from_msg.odometry(r.message) for r in open_recording(folder(tmp_path)).records(["/odom"])]
    assert [pose.T_odom_body[2, 3] for pose in poses] == pytest.approx([0, 0.1, 0.2])
    x, down, forward = poses[0].T_odom_body[:3, :3].T
    assert np.allclose(x, (1, 0, 0)) and np.allclose(down, (0, 0, -1)) and np.allclose(forward, (0, 1, 0))
    assert poses[0].child_frame_id == "camera"


def test_times_of_frames_are_taken_where_they_are_given(tmp_path: Path) -> None:
    recording = open_recording(folder(tmp_path, frameTimestamps=[7.0, 7.5, 9.0]))
    assert [r.stamp_ns for r in recording.records(["/image"])] == [7 * 10**9, 75 * 10**8, 9 * 10**9]


def test_a_pose_that_is_none_is_passed_over(tmp_path: Path) -> None:
    recording = open_recording(folder(tmp_path, poses=[[0] * 7, *METADATA["poses"][1:]]))  # type: ignore[index]
    assert recording.topics["/odom"].count == 2 and "1 of 3 poses of metadata are none" in recording.notes[-1]


@pytest.mark.parametrize(
    ("changes", "said"),
    [({"K": [1, 2]}, "expected K, w and h of a camera"), ({"K": None}, "expected K, w and h of a camera"),
     ({"fps": None}, "expected frameTimestamps or fps"), ({"fps": "x"}, "expected frameTimestamps or fps"),
     ({"poses": [[1]]}, "expected poses of qx qy qz qw tx ty tz")],
)  # fmt: skip
def test_metadata_of_another_kind_are_refused(changes: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=said):
        open_recording(folder(tmp_path, **changes))


def test_a_file_that_is_no_zip_or_cut_is_refused(tmp_path: Path) -> None:
    file = packed(tmp_path)
    file.write_bytes(file.read_bytes()[:-50])
    with pytest.raises(ValueError, match="expected a ZIP as Record3D exports it"):
        open_recording(file)


def test_a_file_without_pictures_is_refused_with_what_it_has(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.r3d", "w") as archive:
        archive.writestr("sound.m4a", b"")
    with pytest.raises(FileNotFoundError, match=r"expected the file metadata of Record3D, got sound\.m4a"):
        open_recording(tmp_path / "a.r3d")
    with zipfile.ZipFile(tmp_path / "a.r3d", "a") as archive:
        archive.writestr("metadata", json.dumps(METADATA))
    with pytest.raises(FileNotFoundError, match="got 0 of colour and 0 of depth"):
        open_recording(tmp_path / "a.r3d")


def test_what_unpacks_to_too_much_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record3d, "FILE_BYTES", 10)
    with pytest.raises(ValueError, match="expected at most 10 bytes of metadata"):
        open_recording(packed(tmp_path))
