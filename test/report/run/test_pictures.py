# SPDX-License-Identifier: Apache-2.0
"""Overlays of scenes that are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording.sample_folders import STEP_NS, records, static, tum_folder, uncalibrated

from objreg_ros.bridge.messages.layout import VIEW
from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.geometry import pose
from objreg_tools.recording import Record, write_rosbag2
from objreg_tools.recording.inputs import Inputs, choose_inputs
from objreg_tools.recording.opening import open_recording
from objreg_tools.recording.rosbag import messages
from objreg_tools.report.run.pictures import WIDTH, Album, chosen_closures, chosen_refusals, data_uri, overlay
from objreg_tools.report.run.run_summary import RunSummary
from report.runs import TRUTH, summary

CAMERA = Intrinsics(fx=300.0, fy=300.0, cx=159.5, cy=119.5, width=WIDTH, height=240)


def wall(shift: int = 0) -> DepthImage:
    """A wall at 2 m with a bright square, ``shift`` px to the right."""
    rgb = np.full((240, WIDTH, 3), 60, np.uint8)
    rgb[100:140, 140 + shift : 180 + shift] = 220
    return DepthImage(depth=np.full((240, WIDTH), 2.0, np.float32), rgb=rgb, intrinsics=CAMERA, stamp_ns=0)


def colourful(picture: np.ndarray) -> int:
    """Pixels of the overlap that are not grey."""
    return int((np.ptp(picture[90:150, 100:230].astype(int), axis=2) > 60).sum())


def test_the_right_motion_makes_grey_and_a_wrong_one_fringes() -> None:
    metres = 30 * 2.0 / CAMERA.fx  # what 30 px are on the wall
    moved = pose(np.eye(3), np.array([-metres, 0.0, 0.0]))
    assert colourful(overlay(wall(), wall(30), moved)) == 0
    assert colourful(overlay(wall(), wall(30), np.eye(4))) > 1500


def test_what_only_one_saw_stays_dark() -> None:
    away = pose(np.eye(3), np.array([1.0, 0.0, 0.0]))  # 150 px to the right
    picture = overlay(wall(), wall(), away)
    assert picture[10, 10].max() < 30 < picture[10, 300].max()


def test_false_closures_are_shown_first() -> None:
    run = RunSummary.of("walk", summary(false=True), TRUTH)
    shown = chosen_closures(run, most=3)
    assert run.is_false(shown[0]) and len(shown) == 3
    assert not any(run.is_false(closure) for closure in shown[1:])


def test_only_what_was_tried_is_shown_as_refused() -> None:
    shown = chosen_refusals(RunSummary.of("walk", summary(), TRUTH))
    assert [refusal.reason.value for refusal in shown] == ["texture_disagrees"] * 2


def test_a_picture_is_inside_the_page() -> None:
    assert data_uri(np.zeros((480, 640, 3), np.uint8)).startswith("data:image/webp;base64,UklGR")


def test_an_album_finds_the_pictures_of_a_moment(shared: Path) -> None:
    with open_recording(shared / "data" / "redkitchen_a") as recording:
        album = Album(recording, choose_inputs(recording.topics))
        seen = album.at(1_000_000_000)
        assert seen is not None and seen.rgb is not None
        assert abs(seen.stamp_ns - 1_000_000_000) < 50_000_000
        assert album.at(10**15) is None


def test_an_album_says_that_a_picture_does_not_decode_and_has_those_beside_it(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path, frames=4)
    (folder / "depth/0.100000.png").write_bytes(b"no png")
    recording = open_recording(folder)
    album = Album(recording, choose_inputs(recording.topics))
    stamps = sorted(round(1e9 * float(file.stem)) for file in (folder / "depth").iterdir())
    assert [album.at(stamp) is not None for stamp in stamps] == [stamp != 100_000_000 for stamp in stamps]
    assert "1 messages of it cannot be read" in album.lacking(100_000_000)


@pytest.mark.parametrize("count", [0, 1])
def test_a_run_of_few_closures_shows_them_all(count: int) -> None:
    run = {**summary(), "constraints": summary()["constraints"][:count]}
    assert len(chosen_closures(RunSummary.of("walk", run, TRUTH))) == count


def test_an_album_says_why_it_has_no_picture_of_a_moment(tmp_path: Path) -> None:
    colourless = [record for record in records(3) if record.topic != "/image" or record.stamp_ns > 10**9]
    write_rosbag2(tmp_path / "bag", colourless)
    with open_recording(tmp_path / "bag") as recording:
        inputs = choose_inputs(recording.topics)
        album = Album(recording, inputs)
        assert album.at(10**9 + STEP_NS) is not None and album.lacking(10**9 + STEP_NS) == ""
        assert album.at(10**9) is None and "nothing on /image is within 50 ms of the depth" in album.lacking(10**9)
        assert "nothing on /depth/image is within 50 ms of the stamp" in album.lacking(5)
        assert "no colour with depth" in Album(recording, replace(inputs, image=None)).lacking(10**9)


def test_a_picture_that_cannot_be_read_is_none_and_said(tmp_path: Path) -> None:
    uncalibrated_records = [uncalibrated(r.stamp_ns) if r.topic == "/camera_info" else r for r in records(3)]
    write_rosbag2(tmp_path / "bag", uncalibrated_records)
    with open_recording(tmp_path / "bag") as recording:
        album = Album(recording, choose_inputs(recording.topics))
        assert album.at(10**9) is None and "expected a calibrated camera_info, got none" in album.lacking(10**9)


def test_an_album_waits_for_the_first_calibrated_camera(tmp_path: Path) -> None:
    late_camera = [
        uncalibrated(r.stamp_ns) if r.topic == "/camera_info" and r.stamp_ns == 10**9 else r for r in records(3)
    ]
    write_rosbag2(tmp_path / "bag", late_camera)
    with open_recording(tmp_path / "bag") as recording:
        assert Album(recording, choose_inputs(recording.topics)).at(10**9) is not None


@pytest.mark.parametrize("coloured", [True, False])
def test_a_cloud_has_its_own_colour_and_needs_no_calibrated_camera(tmp_path: Path, coloured: bool) -> None:
    v, u = np.mgrid[:48, :64]
    rows = np.zeros((48, 64), VIEW if coloured else [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    rows["x"], rows["y"], rows["z"] = (u - 31.5) / 50.0, (v - 23.5) / 50.0, 1.0
    camera_and_cloud = [uncalibrated(5), Record.of("/points", messages.point_cloud(rows, 5, "camera"), 10**12)]
    write_rosbag2(tmp_path / "bag", camera_and_cloud)
    with open_recording(tmp_path / "bag") as recording:
        album = Album(recording, Inputs(points="/points", camera_info="/camera_info"))
        assert (album.at(5) is not None) == coloured
        assert album.lacking(5) == ("" if coloured else "the cloud has no colour")


def test_pictures_and_boxes_of_a_lens_are_shown_rectified_unless_they_are_so_already(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path, frames=1)
    with (folder / "camera.yaml").open("a") as file:
        file.write("\ndistortion: [-0.3, 0.1, 0, 0, 0]\n")
    recording = open_recording(folder)
    inputs = choose_inputs(recording.topics)
    box = Detections(
        xyxy=np.array([[5, 5, 30, 30]], np.float32), score=np.ones(1, np.float32), label=("cup",), image_hw=(48, 64),
        stamp_ns=0,
    )  # fmt: skip
    bent, straight = Album(recording, inputs), Album(recording, inputs, "all")
    seen, raw = bent.at(0), straight.at(0)
    assert seen is not None and raw is not None and seen.shown is not None and raw.shown is None
    assert not np.array_equal(bent.rectified(box).xyxy, box.xyxy) and straight.rectified(box) is box


def test_depth_of_another_sensor_is_shown_as_the_segmenter_gets_it(tmp_path: Path) -> None:
    of_depth = Intrinsics(fx=50.0, fy=50.0, cx=31.5, cy=23.5, width=64, height=48)
    of_colour = Intrinsics(fx=100.0, fy=100.0, cx=63.5, cy=47.5, width=128, height=96)
    recorded = [
        Record.of("/rgb/image", messages.image(np.full((96, 128, 3), 7, np.uint8), "rgb8", 5, "rgb"), 5),
        Record.of("/rgb/camera_info", messages.camera_info(of_colour, 5, "rgb", (-0.1, 0.0, 0.0, 0.0, 0.0)), 5),
        Record.of("/depth/image", messages.image(np.full((48, 64), 1000, np.uint16), "16UC1", 5, "depth"), 5),
        Record.of("/depth/camera_info", messages.camera_info(of_depth, 5, "depth"), 5),
        static("depth", "rgb", pose(np.eye(3), np.array([0.1, 0.0, 0.0])), 5),
    ]
    write_rosbag2(tmp_path / "bag", recorded)
    with open_recording(tmp_path / "bag") as recording:
        album = Album(recording, choose_inputs(recording.topics))
        seen = album.at(5)
        assert seen is not None and seen.frame_id == "rgb" and seen.rgb is not None and (seen.rgb == 7).all()
        assert (seen.depth[24, :59] == 1.0).all() and not seen.depth[24, 59:].any()  # 5 px at 1 m
        box = Detections(
            xyxy=np.array([[5, 5, 60, 60]], np.float32), score=np.ones(1, np.float32), label=("cup",),
            image_hw=(96, 128), stamp_ns=5,
        )  # fmt: skip
        assert not np.array_equal(album.rectified(box).xyxy, box.xyxy)
