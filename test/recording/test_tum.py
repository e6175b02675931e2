# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.bridge import from_msg
from objreg_ros.recording import open_recording

from .folders import tum_folder


@pytest.mark.parametrize("lists", [False, True])
def test_a_folder_is_a_recording_of_standard_messages(lists: bool, tmp_path: Path) -> None:
    recording = open_recording(tum_folder(tmp_path, lists=lists))
    assert {name: topic.count for name, topic in recording.topics.items()} == dict.fromkeys(
        ("/camera_info", "/ground_truth", "/image", "/depth/image"), 3
    )
    first = {r.topic: r.message for r in recording.records(end_ns=1)}
    word = from_msg.depth_image(first["/depth/image"], first["/camera_info"], first["/image"])
    assert word.depth[0, 0] == 1 and word.rgb is not None and word.rgb[0, 0].tolist() == [200, 0, 0]
    assert word.intrinsics.cx == 31.5 and word.frame_id == "camera"


def test_records_come_in_order_of_time(tmp_path: Path) -> None:
    recording = open_recording(tum_folder(tmp_path, lag=0.004))
    seen = [(r.stamp_ns, r.topic) for r in recording.records()]
    assert [stamp for stamp, _ in seen] == sorted(stamp for stamp, _ in seen)
    assert seen[:4] == [(0, "/ground_truth"), (0, "/image"), (4_000_000, "/camera_info"), (4_000_000, "/depth/image")]


def test_a_folder_lasts_until_its_last_picture_has_come(tmp_path: Path) -> None:
    recording = open_recording(tum_folder(tmp_path))
    stamps = [record.stamp_ns for record in recording.records()]
    assert recording.start_ns == stamps[0] and recording.end_ns > stamps[-1]
    part = [record.stamp_ns for record in recording.records(None, recording.start_ns, recording.end_ns)]
    assert part == stamps and recording.seconds == pytest.approx((stamps[-1] - stamps[0]) * 1e-9)


def test_pictures_farther_apart_than_the_association_are_no_pair(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="expected colour and depth pictures within 20 ms"):
        open_recording(tum_folder(tmp_path, lists=True, lag=0.03))


def test_depth_of_another_scale_comes_in_metres(tmp_path: Path) -> None:
    recording = open_recording(tum_folder(tmp_path, scale=5000))
    message = next(recording.records(["/depth/image"], start_ns=200_000_000)).message
    assert message.encoding == "32FC1" and from_msg.depth(message)[5, 5] == pytest.approx(1.2)


def test_a_folder_without_calibration_says_what_is_assumed(tmp_path: Path) -> None:
    (tum_folder(tmp_path, scale=5000) / "camera.yaml").unlink()
    recording = open_recording(tmp_path)
    assert "default camera" in recording.notes[0]
    camera = from_msg.intrinsics(next(recording.records(["/camera_info"])).message)
    assert (camera.fx, camera.width) == (525.0, 64)


def test_a_folder_of_pictures_named_by_time_needs_no_list(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "associations.txt").unlink()
    assert open_recording(tmp_path).topics["/image"].count == 3


def test_a_folder_without_truth_has_no_truth(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "groundtruth.txt").unlink()
    assert "/ground_truth" not in open_recording(tmp_path).topics


def test_a_missing_picture_is_named(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "depth/0.100000.png").unlink()
    with pytest.raises(FileNotFoundError, match=r"expected the picture depth/0\.100000\.png"):
        open_recording(tmp_path)


def test_a_broken_picture_is_named_when_it_is_wanted(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "depth/0.100000.png").write_bytes(b"no png")
    recording = open_recording(tmp_path)
    with pytest.raises(OSError, match=r"0\.100000\.png: expected a picture"):
        _ = [r.message for r in recording.records(["/depth/image"])]


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("associations.txt", "0.0 rgb/0.000000.png 0.0", "expected 4 columns"),
        ("associations.txt", "zero rgb/0.000000.png 0 depth/0.000000.png", "expected a time in seconds, got 'zero'"),
        ("groundtruth.txt", "0.0 0 0 0 0 0 0 0", "expected timestamp tx ty tz"),
        ("groundtruth.txt", "0.0 0 0 0 0 0 0 one", "expected timestamp tx ty tz"),
        ("camera.yaml", "fx: [", "expected YAML"),
        ("camera.yaml", "525", "expected a mapping"),
        ("camera.yaml", "fx: 0", "expected numbers fx fy"),
        ("camera.yaml", "fx: wide", "expected numbers fx fy"),
    ],
)
def test_a_broken_text_is_refused(file: str, text: str, complaint: str, tmp_path: Path) -> None:
    (tum_folder(tmp_path) / file).write_text(text)
    with pytest.raises(ValueError, match=complaint):
        open_recording(tmp_path)


def test_a_real_folder_has_its_frames_and_its_truth(shared: Path) -> None:
    recording = open_recording(shared / "data/redkitchen_a")
    assert {topic.count for topic in recording.topics.values()} == {250}
    first = {r.topic: r.message for r in recording.records(end_ns=1)}
    assert 0.5 < np.median(from_msg.depth(first["/depth/image"])) < 4
    assert from_msg.odometry(first["/ground_truth"]).T_odom_body[0, 3] == pytest.approx(-0.316542)
