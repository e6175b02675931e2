# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bridge import sample_messages as messages
from objreg_ros.bridge.camera import lenses
from objreg_ros.bridge.camera.calibration import Calibration, absolute, fitted, of_numbers, read_calibration
from objreg_ros.bridge.messages import camera_from_msg
from objreg_ros.lens import UPRIGHT

WRITTEN = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [525.5, 0., 319.5, 0., 526.5, 239.5, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, 0, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [500, 0, 320, 0, 0, 501, 240, 0, 0, 0, 1, 0]
"""
K = (525.5, 0.0, 319.5, 0.0, 526.5, 239.5, 0.0, 0.0, 1.0)
P = (500.0, 0.0, 320.0, 0.0, 0.0, 501.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def written(folder: Path, text: str = WRITTEN) -> str:
    file = folder / "camera.yaml"
    file.write_text(text, encoding="utf-8")
    return str(file)


def pinhole(camera: Any) -> tuple[float, ...]:
    intrinsics = camera_from_msg.intrinsics(camera)
    return intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy, intrinsics.width, intrinsics.height


def depth(width: int, height: int) -> Any:
    return messages.image(np.full((height, width), 1000, np.uint16), "16UC1")


def test_four_numbers_are_a_pinhole_camera_of_any_picture_and_six_one_of_a_size() -> None:
    assert pinhole(fitted(read_calibration("525,526, 319.5,239.5"), depth(64, 48))) == (525, 526, 319.5, 239.5, 64, 48)
    assert pinhole(read_calibration("[525.0,526,319.5,239.5,640,480]")) == (525, 526, 319.5, 239.5, 640, 480)


def test_a_file_of_camera_calibration_gives_every_field(tmp_path: Path) -> None:
    camera = read_calibration(written(tmp_path))
    assert (camera.k, camera.p, camera.r, camera.d[:3]) == (K, P, UPRIGHT, (0.1, -0.2, 0.001))
    assert (camera.width, camera.height, camera.distortion_model) == (640, 480, "plumb_bob")
    assert pinhole(camera) == (500, 501, 320, 240, 640, 480)  # P, by which rectified pictures are made
    lens = lenses.lens_of(camera)
    assert lens is not None and lens.raw.fx == 525.5 and "rectified" in lenses.describe(camera)


def test_a_file_may_give_the_matrix_alone(tmp_path: Path) -> None:
    camera = read_calibration(written(tmp_path, "camera_matrix: [5, 0, 2, 0, 5, 1, 0, 0, 1]\nrectification_matrix:\n"))
    assert pinhole(fitted(camera, depth(4, 3))) == (5, 5, 2, 1, 4, 3) and not lenses.is_distorted(camera)


def test_a_camera_of_another_size_of_the_same_shape_is_scaled_about_the_corner_of_the_picture(tmp_path: Path) -> None:
    half = fitted(read_calibration(written(tmp_path)), depth(320, 240))
    assert (half.width, half.height) == (320, 240) and half.d[:2] == (0.1, -0.2)
    assert half.k == (262.75, 0, 159.5, 0, 263.25, 119.5, 0, 0, 1)
    assert half.p == (250, 0, 159.75, 0, 0, 250.5, 119.75, 0, 0, 0, 1, 0)
    corner = np.array([-0.5, -0.5, 1.0])  # the same ray in both sizes
    whole, halved = (np.linalg.solve(np.reshape(k, (3, 3)), corner) for k in (K, half.k))
    assert whole == pytest.approx(halved)


def test_a_picture_of_another_shape_is_refused_with_both_sizes(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected a picture of 640 × 480 or of that shape, got 640 × 360; calibrate"):
        fitted(read_calibration(written(tmp_path)), depth(640, 360))


@pytest.mark.parametrize(
    ("numbers", "why"),
    [
        ("525,525,320", "expected fx,fy,cx,cy or .*, got 3 numbers"),
        ("0,525,320,240", "expected focal lengths above 0, got 0 and 525"),
        ("525,nan,320,240", "expected finite numbers in K"),
        ("525,525,320,240,640,0", "expected a width and height of 1 to 65535, got 640 × 0"),
        ("525,525,320,240,640.5,480", "expected whole pixels of width and height, got 640.5 and 480"),
        ("525,525,320,240,inf,480", "expected whole pixels"),
    ],
)
def test_numbers_that_are_no_camera_are_refused(numbers: str, why: str) -> None:
    with pytest.raises(ValueError, match=f"camera: {why}"):
        read_calibration(numbers)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"data: [525.5, 0.": "data: [525.5"}, "expected 9 numbers in camera_matrix, got 8"),
        ({"data: [525.5": "data: [x"}, r"expected camera_matrix with its numbers as data"),
        ({"plumb_bob": "pinhole_radial"}, "lens: expected a distortion model of plumb_bob, .*got 'pinhole_radial'"),
        ({"image_width: 640": "image_width: wide"}, "expected whole pixels as image_width, got 'wide'"),
        ({"image_width: 640": "image_width: -640"}, "expected whole pixels as image_width, got -640"),
        (
            {"camera_matrix": "matrix"},
            "expected a file of ROS .*got the keys image_width, image_height, ",
        ),
        ({"525.5": "9" * 400}, "expected numbers in camera_matrix that are not too long"),
        ({WRITTEN: "- 1"}, "expected a file of ROS .*, got list"),
        ({WRITTEN: "a: [\n- b"}, "expected YAML, got: "),
    ],
)
def test_a_file_that_is_no_camera_is_refused_by_name(change: dict[str, str], why: str, tmp_path: Path) -> None:
    text = WRITTEN
    for old, new in change.items():
        text = text.replace(old, new)
    with pytest.raises(ValueError, match=rf"camera\.yaml: {why}") as refusal:
        read_calibration(written(tmp_path, text))
    assert "\n" not in str(refusal.value)


def test_what_is_no_file_a_folder_or_endless_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"expected fx,fy,cx,cy or .*OpenCV .*kalibr .*got 'nowhere"):
        read_calibration("nowhere.yaml")
    with pytest.raises(ValueError, match="expected a regular file"):
        read_calibration(str(tmp_path))
    with pytest.raises(ValueError, match="expected at most 1048576 bytes, got 1048577"):
        read_calibration(written(tmp_path, " " * (2**20 + 1)))
    (tmp_path / "bytes").write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="bytes: 'utf-8' codec"):
        read_calibration(str(tmp_path / "bytes"))


def test_messages_of_ros_stay_as_they_are() -> None:
    info = messages.camera_info([5.0, 0, 1, 0, 5, 1, 0, 0, 1], 4, 3)
    assert fitted(info, depth(64, 48)) is info and fitted(None, depth(64, 48)) is None


def test_a_cloud_that_is_not_organised_needs_the_size_and_one_that_is_states_it() -> None:
    camera, dtype = of_numbers((50.0, 50.0, 3.0, 2.0)), np.dtype([("x", "f4"), ("y", "f4"), ("z", "f4")])
    assert pinhole(fitted(camera, messages.cloud(np.zeros((4, 6), dtype))))[4:] == (6, 4)
    flat = messages.cloud(np.zeros((1, 24), dtype))
    with pytest.raises(ValueError, match="expected fx,fy,cx,cy,width,height for points that are not organised"):
        fitted(camera, flat)
    sized = replace(camera, width=6, height=4)
    assert fitted(sized, flat) is sized


def test_the_camera_of_every_frame_is_made_once() -> None:
    camera = of_numbers((50.0, 50.0, 3.0, 2.0))
    assert fitted(camera, depth(64, 48)) is fitted(camera, depth(64, 48))


def test_a_file_is_named_by_its_whole_path_and_numbers_as_they_are(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    assert (absolute("camera.yaml"), absolute("1,2,3,4")) == (str(tmp_path / "camera.yaml"), "1,2,3,4")
    assert absolute("") == "" and Calibration(k=K) == Calibration(k=K)


@pytest.mark.parametrize("name", ["camera_matrix", "image_width", "distortion_model"])
def test_a_small_file_that_unfolds_to_a_large_one_is_refused_and_takes_no_memory(tmp_path: Path, name: str) -> None:
    folds = ["a0: &a0 [x, x, x, x]"] + [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 30)]
    file = tmp_path / "camera.yaml"
    file.write_text("\n".join([*folds, "camera_matrix: [500, 0, 320, 0, 500, 240, 0, 0, 1]", f"{name}: *a29"]))
    with pytest.raises(ValueError, match=f"expected .*{name}"):
        read_calibration(str(file))


def test_a_picture_without_a_size_is_refused() -> None:
    camera = read_calibration("500,500,320,240,640,480")
    with pytest.raises(ValueError, match="expected pixels, got 640 × 0"):
        fitted(camera, SimpleNamespace(width=640, height=0, encoding="16UC1"))
