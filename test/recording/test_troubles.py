# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import pose
from objreg_tools.recording import Record, Recording, open_recording, write_rosbag2
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.summary import describe_topics
from objreg_tools.recording.troubles import troubles, warnings

from .sample_folders import CAMERA, records, static, tum_folder, uncalibrated


def bag(path: Path, items: Iterator[Record] | list[Record]) -> Recording:
    write_rosbag2(path, items)
    return open_recording(path)


def said(recording: Recording) -> str:
    return "\n".join(finding.text for finding in warnings(recording, choose_inputs(recording.topics)))


def depth_and_colour(
    depth: np.ndarray, encoding: str, camera: Intrinsics = CAMERA, later: int = 0, frame_id: str = "c"
) -> list[Record]:
    rgb = np.zeros((48, 64, 3), np.uint8)
    return [
        Record.of("/camera_info", messages.camera_info(camera, 5, "c"), 5),
        Record.of("/image", messages.image(rgb, "rgb8", 5, "c"), 5),
        Record.of("/depth/image", messages.image(depth, encoding, 5 + later, frame_id), 5),
    ]


METRE = np.full((48, 64), 1000, np.uint16)


def test_a_good_recording_has_no_warning_but_of_its_missing_truth(tmp_path: Path) -> None:
    assert said(bag(tmp_path / "bag", records())) == "no ground truth: the true error of constraints is not known"


def test_what_keeps_the_graph_from_running_is_said(tmp_path: Path) -> None:
    recording = bag(tmp_path / "bag", [r for r in records() if r.topic in ("/image", "/depth/image")])
    assert "the graph cannot run: expected the camera_info of the depth image (or --camera fx,fy,cx,cy)" in said(
        recording
    )


def test_depth_that_does_not_fit_its_camera_is_said(tmp_path: Path) -> None:
    large = Intrinsics(fx=100.0, fy=100.0, cx=64.0, cy=48.0, width=128, height=96)
    recording = bag(tmp_path / "bag", depth_and_colour(METRE, "16UC1", large))
    assert "depth has 64 × 48 pixels and its camera_info 128 × 96" in said(recording)


def test_depth_of_another_size_than_colour_is_said(tmp_path: Path) -> None:
    small = Intrinsics(fx=25.0, fy=25.0, cx=15.5, cy=11.5, width=32, height=24)
    recording = bag(tmp_path / "bag", depth_and_colour(METRE[::2, ::2], "16UC1", small))
    assert "colour has 64 × 48 pixels and depth 32 × 24" in said(recording)


def test_depth_in_another_frame_than_colour_is_said_with_how_to_register_it(tmp_path: Path) -> None:
    recording = bag(tmp_path / "bag", depth_and_colour(METRE, "16UC1", frame_id="camera_depth_optical_frame"))
    text = said(recording)
    assert "colour is in the frame c and depth in camera_depth_optical_frame" in text
    assert "align_depth.enable:=true" in text and "depth_registered" in text


def test_depth_that_is_registered_here_is_no_trouble_but_a_remark(tmp_path: Path) -> None:
    of_colour = Intrinsics(fx=80.0, fy=80.0, cx=31.5, cy=23.5, width=64, height=48)
    info = Record.of("/colour/camera_info", messages.camera_info(of_colour, 5, "c"), 5)
    items = [*depth_and_colour(METRE, "16UC1", frame_id="depth"), info]
    names = {"/image": "/colour/image", "/camera_info": "/depth/camera_info"}
    items = [Record.of(names.get(r.topic, r.topic), r.message, 5) for r in items]
    tied = static("depth", "c", pose(np.eye(3), np.array([0.05, 0.0, 0.0])), 5)
    recording = bag(tmp_path / "tied", [*items, tied])
    inputs = choose_inputs(recording.topics)
    remark = "depth of 'depth' is registered here to colour of 'c', with -5.0 0.0 0.0 cm between them, as 40 × 30 px"
    assert remark in said(recording) and not troubles(recording, inputs)
    loose = bag(tmp_path / "loose", items)
    (found,) = troubles(loose, inputs)
    assert found.anchor == "depth-is-not-registered" and "/tf_static between the two frames" in found.text


@pytest.mark.parametrize("frame_id", ["c", "/c", ""])
def test_depth_in_the_frame_of_colour_or_in_none_is_fine(frame_id: str, tmp_path: Path) -> None:
    assert "in the frame" not in said(bag(tmp_path / "bag", depth_and_colour(METRE, "16UC1", frame_id=frame_id)))


def test_an_imu_that_is_mounted_nobody_knows_how_is_said_with_what_to_set(tmp_path: Path) -> None:
    stamps = range(10**9, 2 * 10**9, 10**7)
    felt = [Record.of("/imu", messages.imu((0, -9.8, 0), (0, 0, 0.1), ns, "imu"), ns) for ns in stamps]
    recording = bag(tmp_path / "bag", sorted([*records(), *felt], key=lambda record: record.stamp_ns))
    assert "the IMU is in the frame imu and depth in camera" in said(recording)
    (line,) = (line for line in describe_topics(recording) if line.topic == "/imu")
    assert line.what == "acceleration, turns, imu"


def test_only_depth_that_would_be_used_is_looked_at(tmp_path: Path) -> None:
    rows = np.ones((48, 64), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    cloud = Record.of("/points", messages.point_cloud(rows, 5, "c"), 5)
    recording = bag(tmp_path / "bag", [*depth_and_colour(METRE, "16UC1", frame_id="other"), cloud])
    inputs = choose_inputs(recording.topics, source="points")
    assert inputs.points and not [warning for warning in warnings(recording, inputs) if "in the frame" in warning.text]


def test_an_encoding_that_no_node_reads_is_said(tmp_path: Path) -> None:
    recording = bag(tmp_path / "bag", depth_and_colour(METRE, "12UC7"))
    assert "depth: expected an encoding of 16UC1, mono16, 32FC1, got '12UC7'" in said(recording)


def test_stamps_that_do_not_meet_are_said(tmp_path: Path) -> None:
    recording = bag(tmp_path / "bag", depth_and_colour(METRE, "16UC1", later=50_000_000))
    assert "colour and depth are 50 ms apart" in said(recording) and "--set segmenter.slop=0.06" in said(recording)


def streams(path: Path, colour_hz: float, depth_hz: float, colour_from_s: float = 0.0, later_s: float = 0.0) -> str:
    """What is said of 12 s of colour and depth; depth is stamped ``later_s`` after its time."""
    rgb, said_at = np.zeros((4, 4, 3), np.uint8), []
    for k in range(round(12 * colour_hz)):
        at = round((colour_from_s + k / colour_hz) * 1e9)
        said_at.append(Record.of("/image", messages.image(rgb, "rgb8", at, "c"), at))
    for k in range(round(12 * depth_hz)):
        at, stamp_ns = round(k / depth_hz * 1e9), round((k / depth_hz + later_s) * 1e9)
        said_at.append(Record.of("/depth/image", messages.image(METRE[:4, :4], "16UC1", stamp_ns, "c"), at))
    return said(bag(path, sorted(said_at, key=lambda record: record.stamp_ns)))


@pytest.mark.parametrize(
    ("colour_hz", "depth_hz", "colour_from_s"), [(30, 10, 0), (10, 30, 0), (30, 5, 0), (30, 30, 5)]
)
def test_streams_of_other_rates_and_beginnings_that_meet_are_fine(
    colour_hz: float, depth_hz: float, colour_from_s: float, tmp_path: Path
) -> None:
    text = streams(tmp_path / "bag", colour_hz, depth_hz, colour_from_s)
    assert "apart" not in text and "different times" not in text


def test_how_far_the_slower_stream_is_from_the_faster_one_is_said(tmp_path: Path) -> None:
    assert "colour and depth are 40 ms apart" in streams(tmp_path / "bag", 10, 5, later_s=0.04)


def test_a_steady_lag_is_no_reason_for_a_wider_slop(tmp_path: Path) -> None:
    steady = streams(tmp_path / "steady", 10, 10, later_s=0.04)
    assert "colour and depth are 40 ms apart all the time" in steady and "segmenter.slop" not in steady
    assert "segmenter.slop" in streams(tmp_path / "free", 5.3, 6, later_s=0.04)


def test_streams_one_after_the_other_are_said(tmp_path: Path) -> None:
    assert "colour and depth were recorded at different times" in streams(tmp_path / "bag", 5, 5, colour_from_s=60)


@pytest.mark.parametrize("stamp_ns", [0, 7 * 10**9])
def test_stamps_that_stand_still_are_said(stamp_ns: int, tmp_path: Path) -> None:
    rgb = np.zeros((4, 4, 3), np.uint8)
    pictures = [Record.of("/image", messages.image(rgb, "rgb8", stamp_ns, "c"), 9 + i) for i in range(3)]
    text = said(bag(tmp_path / "bag", pictures))
    assert f"the first 3 stamps of colour are all {stamp_ns} ns" in text and "record it again" in text


def test_stamps_that_go_back_are_said(tmp_path: Path) -> None:
    rgb = np.zeros((4, 4, 3), np.uint8)
    pictures = [Record.of("/image", messages.image(rgb, "rgb8", t, "c"), 9 + i) for i, t in enumerate((7, 8, 5))]
    assert "the stamps of colour go back in time" in said(bag(tmp_path / "bag", pictures))


@pytest.mark.parametrize(("height", "complaints"), [(48, 0), (1, 2)])
def test_an_uncalibrated_camera_is_said_only_where_a_cloud_needs_one(
    height: int, complaints: int, tmp_path: Path
) -> None:
    rows = np.ones((height, 64), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    cloud = Record.of("/points", messages.point_cloud(rows, 5, "c"), 5)
    _, image, _ = depth_and_colour(METRE, "16UC1")
    text = said(bag(tmp_path / "bag", [uncalibrated(5), image, cloud]))
    assert text.count("expected a calibrated K") + text.count("not organised") == complaints


def test_what_the_reader_assumed_is_passed_on(tmp_path: Path) -> None:
    (tum_folder(tmp_path, scale=5000) / "camera.yaml").unlink()
    assert "default camera" in said(open_recording(tmp_path))


@pytest.mark.parametrize(("millimetres", "words"), [(6000, "depth begins at 6.0 m"), (3, "depth ends at 0.003 m")])
def test_depth_in_other_steps_than_its_encoding_says_is_found(millimetres: int, words: str, tmp_path: Path) -> None:
    depth = np.full((48, 64), millimetres, np.uint16)
    recording = bag(tmp_path / "bag", depth_and_colour(depth, "16UC1"))
    (found,) = troubles(recording, choose_inputs(recording.topics))
    assert found.what == words and found.anchor == "depth-scale"


def test_what_only_informs_is_no_trouble_of_a_run(tmp_path: Path) -> None:
    recording = bag(tmp_path / "bag", records())
    assert warnings(recording, choose_inputs(recording.topics)) and not troubles(
        recording, choose_inputs(recording.topics)
    )


def test_stamps_of_two_clocks_are_not_to_be_bridged(tmp_path: Path) -> None:
    text = said(bag(tmp_path / "bag", depth_and_colour(METRE, "16UC1", later=10**9)))
    assert "record both with stamps of one clock" in text and "segmenter.slop=" not in text


def test_a_folder_of_pictures_is_not_advised_to_take_other_topics(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    (folder / "camera.yaml").write_text("fx: 50\nfy: 50\ncx: 31.5\ncy: 23.5\nwidth: 64\nheight: 64\ndepth_scale: 1000")
    recording = open_recording(folder)
    assert "depth has 64 × 48 pixels and its camera_info 64 × 64" in said(recording)
    assert "give camera.yaml the width, height, fx, fy, cx and cy of the depth pictures" in said(recording)
    lacking = choose_inputs(recording.topics, {"depth": ""})
    texts = "\n".join(finding.text for finding in warnings(recording, lacking))
    assert "the graph cannot run: expected points or a depth image" in texts and "leave out --remap" in texts
    assert "--remap input:=/topic" not in texts + said(recording)


def test_colour_of_another_shape_in_a_folder_is_to_be_exported_anew(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    for file in (folder / "rgb").iterdir():
        cv2.imwrite(str(file), np.zeros((72, 128, 3), np.uint8))
    assert "export depth and colour of one field of view" in said(open_recording(folder))


def test_colour_and_depth_of_two_cameras_are_named_with_the_remaps_that_join_them(tmp_path: Path) -> None:
    renamed = {"/image": "/front/rgb/image_raw", "/depth/image": "/back/depth_registered/image_raw"}
    items = [
        replace(r, topic=renamed[r.topic]) for r in depth_and_colour(METRE, "16UC1", frame_id="d") if r.topic in renamed
    ]
    text = said(bag(tmp_path / "bag", items))
    assert "colour /front/rgb/image_raw and depth /back/depth_registered/image_raw are of two cameras" in text
    assert "--remap image:=/front/rgb/image_raw --remap depth/image:=/back/depth_registered/image_raw" in text
