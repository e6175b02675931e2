# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import signal
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_ros.bridge.camera import lenses
from objreg_ros.bridge.messages import camera_from_msg, from_msg, motion_from_msg
from objreg_tools.recording import open_recording
from objreg_tools.recording.folders.tum import ASSOCIATION_NS, Picture, _associate
from objreg_tools.recording.inputs import choose_inputs
from recording.sample_folders import numbered_folder, tum_folder


@pytest.mark.parametrize("lists", [False, True])
def test_a_folder_is_a_recording_of_standard_messages(lists: bool, tmp_path: Path) -> None:
    recording = open_recording(tum_folder(tmp_path, lists=lists))
    assert {name: topic.count for name, topic in recording.topics.items()} == dict.fromkeys(
        ("/camera_info", "/ground_truth", "/image", "/depth/image"), 3
    )
    first = {r.topic: r.message for r in recording.records(end_ns=1)}
    read = from_msg.depth_image(first["/depth/image"], first["/camera_info"], first["/image"])
    assert read.depth[0, 0] == 1 and read.rgb is not None and read.rgb[0, 0].tolist() == [200, 0, 0]
    assert read.intrinsics.cx == 31.5 and read.frame_id == "camera"


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


def test_an_accelerometer_is_an_imu_around_the_time_of_the_pictures(tmp_path: Path) -> None:
    tum_folder(tmp_path)
    lines = [f"{t:.4f} 0.1 -9.7 0.5" for t in (-2.0, -0.1, 0.05, 0.15, 9.0)]
    (tmp_path / "accelerometer.txt").write_text("# timestamp ax ay az\n" + "\n".join(lines))
    recording = open_recording(tmp_path)
    felt = [motion_from_msg.imu(record.message) for record in recording.records(["/imu"])]
    assert recording.topics["/imu"].count == len(felt) == 3
    assert [sample.stamp_ns for sample in felt] == [-100_000_000, 50_000_000, 150_000_000]
    assert felt[0].acceleration is not None and felt[0].acceleration.tolist() == [0.1, -9.7, 0.5]
    assert felt[0].angular_velocity is None and felt[0].orientation is None and felt[0].frame_id == "accelerometer"
    assert choose_inputs(recording.topics).imu == "/imu"


def test_a_row_of_the_accelerometer_that_is_none_is_refused_by_name(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "accelerometer.txt").write_text("0.0 a b c")
    with pytest.raises(ValueError, match=r"expected timestamp ax ay az, got 0\.0 a b c"):
        open_recording(tmp_path)


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
    camera = camera_from_msg.intrinsics(next(recording.records(["/camera_info"])).message)
    assert (camera.fx, camera.width) == (52.5, 64)


def test_what_a_folders_calibration_lacks_is_said(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "camera.yaml").write_text("fx: 50\nfy: 50\ncx: 31.5\ncy: 23.5\ndepth_factor: 1000")
    assert open_recording(tmp_path).notes == [
        "camera.yaml does not give all of the camera, so this is assumed: depth_scale 5000",
        "camera.yaml: not known, and not used: depth_factor",
    ]


def test_a_folder_of_pictures_named_by_time_needs_no_list(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "associations.txt").unlink()
    assert open_recording(tmp_path).topics["/image"].count == 3


@pytest.mark.parametrize("lists", [False, True])
def test_pictures_in_any_order_lose_no_pair(lists: bool, tmp_path: Path) -> None:
    folder = numbered_folder(tmp_path, {f"{9 + k / 2:.1f}": k for k in range(5)})  # "10.0" is before "9.0" in a list
    if lists:
        for name in ("rgb", "depth"):
            files = sorted((folder / name).iterdir())
            (folder / f"{name}.txt").write_text("\n".join(f"{file.stem} {name}/{file.name}" for file in files))
    recording = open_recording(folder)
    assert [r.stamp_ns // 10**6 for r in recording.records(["/image"])] == [9000, 9500, 10000, 10500, 11000]
    assert [int(from_msg.image(r.message).rgb[0, 0, 0]) for r in recording.records(["/image"])] == [0, 1, 2, 3, 4]
    assert not [note for note in recording.notes if "partner" in note]


def test_pictures_named_in_nanoseconds_are_read_to_the_last_digit(tmp_path: Path) -> None:
    recording = open_recording(numbered_folder(tmp_path, {"1403636579763555584": 0, "1403636579813555456": 1}))
    assert [r.stamp_ns for r in recording.records(["/image"])] == [1403636579763555584, 1403636579813555456]


def test_files_among_the_pictures_that_are_none_are_left_out_by_name(tmp_path: Path) -> None:
    folder = numbered_folder(tmp_path, {"1.0": 0, "2.0": 1})
    for name in ("rgb/.DS_Store", "rgb/._1.0.png", "rgb/Thumbs.db", "depth/notes.txt"):
        (folder / name).write_text("x")
    recording = open_recording(folder)
    assert recording.topics["/image"].count == 2
    note = "no pictures, and left out: rgb/.DS_Store, rgb/._1.0.png, rgb/Thumbs.db, depth/notes.txt"
    assert note in recording.notes


@pytest.mark.parametrize("comment", ["\ufeff# times", "  # times", "\t# times"])
def test_a_comment_may_follow_a_byte_order_mark_or_spaces(comment: str, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    for name in ("associations.txt", "groundtruth.txt"):
        (folder / name).write_text(f"{comment}\n{(folder / name).read_text()}", encoding="utf-8")
    assert open_recording(folder).topics["/ground_truth"].count == 3


def test_a_text_of_another_encoding_is_refused_by_name(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "groundtruth.txt").write_bytes("# caf\xe9\n".encode("latin-1"))
    with pytest.raises(ValueError, match=r"groundtruth\.txt: expected text in UTF-8"):
        open_recording(tmp_path)


def test_colour_is_not_turned_as_its_camera_was_held_since_depth_is_not(tmp_path: Path) -> None:
    folder = numbered_folder(tmp_path, {"1.0": 0})
    (folder / "rgb/1.0.png").unlink()
    cv2.imwrite(str(folder / "depth/1.0.png"), np.full((4, 8), 5000, np.uint16))
    _, jpeg = cv2.imencode(".jpg", np.zeros((4, 8, 3), np.uint8))
    turned = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"  # TIFF: orientation 6
    exif = b"\xff\xe1" + (len(turned) + 8).to_bytes(2, "big") + b"Exif\0\0" + turned
    (folder / "rgb/1.0.jpg").write_bytes(jpeg[:2].tobytes() + exif + jpeg[2:].tobytes())
    assert cv2.imread(str(folder / "rgb/1.0.jpg")).shape == (8, 4, 3)
    recording = open_recording(folder)
    assert from_msg.image(next(recording.records(["/image"])).message).rgb.shape == (4, 8, 3)
    info = next(recording.records(["/camera_info"])).message
    assert (info.width, info.height) == (8, 4)


def test_pictures_without_a_partner_are_counted(tmp_path: Path) -> None:
    folder = numbered_folder(tmp_path, {f"{k}.0": k for k in range(4)})
    (folder / "depth/2.0.png").unlink()
    (folder / "rgb/3.0.png").rename(folder / "rgb/3.5.png")
    notes = open_recording(folder).notes
    assert "2 of 4 colour and 1 of 3 depth pictures have no partner within 20 ms and are left out" in notes


def test_a_folder_without_truth_has_no_truth(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "groundtruth.txt").unlink()
    assert "/ground_truth" not in open_recording(tmp_path).topics


@pytest.mark.parametrize("numbers", ["0 0 0 0 0 0 0", "nan nan nan 0 0 0 1", "0 0 0 nan nan nan nan"])
def test_a_row_of_the_truth_that_is_no_pose_is_passed_over_and_counted(numbers: str, tmp_path: Path) -> None:
    file = tum_folder(tmp_path) / "groundtruth.txt"
    file.write_text(f"{file.read_text()}\n0.05 {numbers}")
    recording = open_recording(tmp_path)
    assert [r.stamp_ns for r in recording.records(["/ground_truth"])] == [0, 100_000_000, 200_000_000]
    assert "1 of 4 poses of groundtruth.txt are none" in recording.notes[0]


def test_a_missing_picture_is_named(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "depth/0.100000.png").unlink()
    with pytest.raises(FileNotFoundError, match=r"expected the picture depth/0\.100000\.png"):
        open_recording(tmp_path)


def test_a_broken_picture_is_named_when_it_is_wanted(tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "depth/0.100000.png").write_bytes(b"no png")
    recording = open_recording(tmp_path)
    with pytest.raises(ValueError, match=r"0\.100000\.png: expected a picture"):
        _ = [r.message for r in recording.records(["/depth/image"])]
    assert [r.read() is None for r in recording.records(["/depth/image"])] == [False, True, False]


def test_a_broken_first_picture_keeps_no_folder_from_being_read(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    (folder / "rgb/0.000000.png").write_bytes(b"no png")
    info = next(open_recording(folder).records(["/camera_info"])).message
    assert (info.width, info.height) == (64, 48)
    for file in (folder / "rgb").iterdir():
        file.write_bytes(b"no png")
    with pytest.raises(ValueError, match=r"0\.000000\.png: expected a picture, got 3 that do not decode"):
        open_recording(folder)


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("associations.txt", "0.0 rgb/0.000000.png 0.0", "expected 4 columns"),
        ("associations.txt", "zero rgb/0.000000.png 0 depth/0.000000.png", "expected a time in .*, got 'zero'"),
        *[
            ("associations.txt", f"{time} rgb/0.000000.png 0 depth/0.000000.png", "expected a time in seconds")
            for time in ("inf", "nan", "1e400", "1e999999999", "9000000000000000000", "1305031102175")
        ],
        ("groundtruth.txt", "0.0 0 0 0 0 0 0 one", "expected timestamp tx ty tz"),
        ("camera.yaml", "fx: [", "expected YAML"),
        ("camera.yaml", "525", "expected a file of ROS .*, got int"),
        ("camera.yaml", "fx: 0", "expected numbers fx fy"),
        ("camera.yaml", "fx: wide", "expected numbers fx fy"),
        *[
            ("camera.yaml", f"fx: 50\ndepth_scale: {scale}", "got: depth_scale")
            for scale in ("0", "-1000", ".nan", ".inf")
        ],
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
    assert motion_from_msg.odometry(first["/ground_truth"]).T_odom_body[0, 3] == pytest.approx(-0.316542)


def outside(folder: Path) -> Path:
    """A picture beside the folder."""
    picture = folder.parent / "secret.png"
    cv2.imwrite(str(picture), np.zeros((48, 64, 3), np.uint8))
    return picture


@pytest.mark.parametrize(
    "name", ["../secret.png", "{}", "rgb/../../secret.png", "rgb/link.png", "linked/secret.png", ".."]
)
def test_a_list_does_not_reach_out_of_its_folder(name: str, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    secret = outside(folder)
    (folder / "rgb/link.png").symlink_to(secret)
    (folder / "linked").symlink_to(tmp_path)
    (folder / "associations.txt").write_text(f"0.0 {name.format(secret)} 0.0 depth/0.000000.png")
    with pytest.raises(ValueError, match=r"tum: expected pictures inside of this folder, got .* copy it there"):
        open_recording(folder)


def test_links_within_the_folder_and_to_the_folder_are_followed(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum")
    (folder / "other").symlink_to(folder / "rgb")
    (folder / "other/link.png").symlink_to("0.000000.png")
    (folder / "associations.txt").write_text("0.0 other/link.png 0.0 rgb/../depth/0.000000.png")
    (tmp_path / "alias").symlink_to(folder)
    for place in (folder, tmp_path / "alias"):
        assert next(open_recording(place).records(["/image"])).message.width == 64


@pytest.mark.parametrize("name", ["rgb/loop.png", "rgb/0.000000.png/x", "rgb/dangling.png"])
def test_links_and_names_that_lead_nowhere_are_missing(name: str, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    (folder / "rgb/loop.png").symlink_to("loop.png")
    (folder / "rgb/dangling.png").symlink_to("nowhere.png")
    (folder / "associations.txt").write_text(f"0.0 {name} 0.0 depth/0.000000.png")
    with pytest.raises(OSError, match=r"expected the picture|symbolic links"):
        open_recording(folder)


@pytest.mark.parametrize("file", ["rgb/0.000000.png", "associations.txt", "groundtruth.txt", "camera.yaml"])
def test_a_pipe_in_a_folder_is_not_waited_for(file: str, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    (folder / file).unlink()
    os.mkfifo(folder / file)
    with pytest.raises(ValueError, match=rf"{file}: expected a regular file, got a pipe"):
        open_recording(folder)


def test_a_picture_that_opencv_refuses_is_named(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    file = folder / "depth/0.100000.png"
    content = bytearray(file.read_bytes())
    content[16:24] = b"\0\0\xff\xff" * 2  # the size in the header
    content[29:33] = zlib.crc32(content[12:29]).to_bytes(4, "big")
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"0\.100000\.png: expected a picture, got"):
        _ = [record.message for record in open_recording(folder).records(["/depth/image"])]


def greedy(colour: list[Picture], depth: list[Picture]) -> list[tuple[int, int]]:
    """The stamps of the pairs as the benchmark makes them, in the plainest way."""
    near = sorted((abs(c - d), c, d) for c, _ in colour for d, _ in depth if abs(c - d) <= ASSOCIATION_NS)
    pairs: dict[int, int] = {}
    for _, c, d in near:
        if c not in pairs and d not in pairs.values():
            pairs[c] = d
    return sorted(pairs.items())


def test_pairs_are_those_of_the_plain_way(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    for _ in range(20):
        step = 45_000_000  # so that a picture has at most two neighbours in reach
        colour, depth = ([(int(i * step + random.integers(0, step // 2)), f"{i}") for i in range(30)] for _ in range(2))
        assert [(c, d) for c, _, d, _ in _associate(colour, depth)] == greedy(colour, depth)


def test_the_work_for_a_list_grows_as_the_list() -> None:
    count = 100_000
    pictures = [(i * 33_000_000, str(i)) for i in range(count)]
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("the pairs of a long list do not end"))
    signal.alarm(60)
    try:
        assert len(_associate(pictures, pictures)) == count
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def test_the_distortion_of_a_folder_s_camera_is_undone_in_depth_and_colour(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    with (folder / "camera.yaml").open("a") as file:
        file.write("\ndistortion: [-0.3, 0.1, 0.001, 0.002, 0]\n")
    first = {r.topic: r.message for r in open_recording(folder).records(end_ns=1)}
    said = first["/depth/image"], first["/camera_info"], first["/image"]
    rectified, raw, of = lenses.depth_image(*said), from_msg.depth_image(*said), lenses.lens_of(first["/camera_info"])
    assert of is not None and of.D == (-0.3, 0.1, 0.001, 0.002, 0)
    assert np.array_equal(rectified.depth, of.rectify_depth(raw.depth)) and (rectified.depth > 0).any()
    assert raw.rgb is not None and np.array_equal(rectified.rgb, of.rectify_colour(raw.rgb))


@pytest.mark.parametrize("sign", [",", ", ", "\t", ";"])
@pytest.mark.parametrize("lists", [False, True])
def test_columns_may_be_parted_by_commas(lists: bool, sign: str, tmp_path: Path) -> None:
    plain, parted = tum_folder(tmp_path / "plain", lists=lists), tum_folder(tmp_path / "parted", lists=lists)
    for file in parted.glob("*.txt"):
        file.write_bytes(b"\xef\xbb\xbf" + file.read_text().replace("\n", "\r\n").replace(" ", sign).encode())
    stamps = [[(r.stamp_ns, r.topic) for r in open_recording(folder).records()] for folder in (plain, parted)]
    assert stamps[0] == stamps[1] and len(stamps[0]) == 12


def test_depth_may_come_first_in_a_list_of_pairs(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path, lag=0.004)
    lines = [line.split() for line in (folder / "associations.txt").read_text().splitlines()]
    (folder / "associations.txt").write_text("\n".join(" ".join([*line[2:], *line[:2]]) for line in lines))
    recording = open_recording(folder)
    assert "associations.txt has depth in its first columns" in recording.notes
    assert [r.stamp_ns for r in recording.records(["/depth/image"])] == [4_000_000, 104_000_000, 204_000_000]
    assert from_msg.image(next(recording.records(["/image"])).message).rgb[0, 0].tolist() == [200, 0, 0]


def test_the_numbers_of_frames_are_said_to_be_no_times(tmp_path: Path) -> None:
    folder = numbered_folder(tmp_path, {"0": 0, "1": 10, "2": 20})
    (folder / "groundtruth.txt").write_text("0.0 0 0 0 0 0 0 1\n0.5 1 0 0 0 0 0 1\n")
    notes = open_recording(folder).notes
    assert "times are the numbers of frames: each is taken for a second" in notes
    assert "groundtruth.txt has other times than the pictures, which are the numbers of frames" in notes
    assert not any("numbers of frames" in n for n in open_recording(tum_folder(tmp_path / "timed")).notes)


def test_the_truth_is_read_as_its_header_names_the_columns(tmp_path: Path) -> None:
    folder = numbered_folder(tmp_path, {"1403636579763555584": 0})
    header = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
    (folder / "groundtruth.txt").write_text(f"{header}\n1403636579763555584,1,2,3,0,0,0,1\n")
    true = motion_from_msg.odometry(next(open_recording(folder).records(["/ground_truth"])).message)
    assert true.stamp_ns == 1403636579763555584 and true.T_odom_body[:3, 3].tolist() == [1, 2, 3]
    assert np.allclose(true.T_odom_body[:3, :3], np.diag([-1, -1, 1]))


@pytest.mark.parametrize("of_colour", [False, True])
def test_larger_colour_is_brought_to_the_size_of_depth(of_colour: bool, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path)
    for file in (folder / "rgb").iterdir():
        cv2.imwrite(str(file), np.full((96, 128, 3), (0, 0, 200), np.uint8))
    if of_colour:
        (folder / "camera.yaml").write_text("fx: 100\nfy: 100\ncx: 63.5\ncy: 47.5\ndepth_scale: 1000\n")
    recording = open_recording(folder)
    first = {r.topic: r.message for r in recording.records(end_ns=1)}
    read = from_msg.depth_image(first["/depth/image"], first["/camera_info"], first["/image"])
    assert read.rgb is not None and read.rgb.shape == (48, 64, 3) and read.rgb[0, 0].tolist() == [200, 0, 0]
    assert (read.intrinsics.fx, read.intrinsics.cx, read.intrinsics.cy) == (50, 31.5, 23.5)
    assert "colour has 128 × 96 pixels and depth 64 × 48: colour is brought to the size of depth" in recording.notes
