# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_ros.bridge.camera.calibration import Calibration, of_file, read_calibration, read_camera
from objreg_ros.bridge.camera.calibration_files import parse_camera

K = (525.0, 0.0, 320.0, 0.0, 520.0, 240.0, 0.0, 0.0, 1.0)
ROS = "image_width: 640\nimage_height: 480\ncamera_matrix: {data: [525.0, 0, 320, 0, 520, 240, 0, 0, 1]}\n"
RTABMAP = (
    "%YAML:1.0\n---\ncamera_name: kinect\nimage_width: 640\nimage_height: 480\ncamera_matrix:\n   rows: 3\n   cols: 3\n"
    "   data: [ 525., 0., 320., 0., 520., 240., 0., 0., 1. ]\ndistortion_coefficients:\n   rows: 1\n   cols: 5\n"
    "   data: [ 0.1, -0.2, 0., 0., 0. ]\ndistortion_model: plumb_bob\n"
)
ECHO = (
    "header:\n  stamp:\n    sec: 17\n    nanosec: 0\n  frame_id: camera\nheight: 480\nwidth: 640\n"
    "distortion_model: plumb_bob\nd:\n- 0.1\n- -0.2\n- 0.0\n- 0.0\n- 0.0\nk:\n" + "".join(f"- {value}\n" for value in K)
    + "binning_x: 0\nbinning_y: 0\nroi:\n"
    "  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: false\n---\n"
)  # fmt: skip
OST = (
    "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n[narrow_stereo]\n\ncamera matrix\n"
    "525.0 0.0 320.0\n0.0 520.0 240.0\n0.0 0.0 1.0\n\ndistortion\n0.1 -0.2 0.0 0.0 0.0\n\nrectification\n1.0 0.0 0.0\n"
    "0.0 1.0 0.0\n0.0 0.0 1.0\n\nprojection\n525.0 0.0 320.0 0.0\n0.0 520.0 240.0 0.0\n0.0 0.0 1.0 0.0\n"
)
ORB = (
    '%YAML:1.0\n# a comment\nCamera.type: "PinHole"\nCamera.width: 640\nCamera.height: 480\n{0}.fx: 525.0\n'
    "{0}.fy: 520.0\n{0}.cx: 320.0\n{0}.cy: 240.0\n{0}.k1: 0.1\n{0}.k2: -0.2\n"
)
KALIBR = (
    "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, -0.2, 0.0, 0.0]\n  distortion_model: radtan\n"
    "  intrinsics: [525.0, 520.0, 320.0, 240.0]\n  resolution: [640, 480]\n"
)
OPEN3D = {"width": 640, "height": 480, "intrinsic_matrix": [525.0, 0, 0, 0, 520.0, 0, 320.0, 240.0, 1]}


def opencv(folder: Path, end: str) -> str:
    """What OpenCV's own storage writes of the camera."""
    storage = cv2.FileStorage(str(folder / f"camera{end}"), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", np.reshape(K, (3, 3)))
    storage.write("distortion_coefficients", np.array([[0.1], [-0.2], [0], [0], [0]]))
    storage.release()
    return (folder / f"camera{end}").read_text()


def camera(text: str) -> Calibration:
    return of_file(parse_camera(text))


@pytest.mark.parametrize(
    "text",
    [RTABMAP, ECHO, OST, ORB.format("Camera"), ORB.format("Camera1"), KALIBR,
     ECHO.replace("\nd:", "\nD:").replace("\nk:", "\nK:"), "A message was lost!!!\n\ttotal count change:1\n" + ECHO],
    ids=["rtabmap", "echo", "ost", "orb_slam2", "orb_slam3", "kalibr", "echo of ROS 1", "echo with a warning"],
)  # fmt: skip
def test_a_file_of_a_tool_is_the_camera_with_its_lens(text: str) -> None:
    read = camera(text)
    assert (read.k, read.width, read.height, read.distortion_model) == (K, 640, 480, "plumb_bob")
    assert read.d[:4] == (0.1, -0.2, 0, 0)


@pytest.mark.parametrize("end", [".yml", ".xml"])
def test_what_opencv_stores_is_the_camera(end: str, tmp_path: Path) -> None:
    read = camera(opencv(tmp_path, end))
    assert (read.k, read.width, read.height) == (K, 640, 480) and read.d == (0.1, -0.2, 0, 0, 0)


@pytest.mark.parametrize(
    "known",
    [OPEN3D, {"intrinsic": OPEN3D, "extrinsic": [1]}, {**OPEN3D, "intrinsic_matrix": K},
     {**OPEN3D, "intrinsic_matrix": np.reshape(K, (3, 3)).tolist()}],
    ids=["columns", "within a view", "rows", "rows of rows"],
)  # fmt: skip
def test_open3d_s_matrix_is_taken_by_columns_or_by_rows(known: dict) -> None:
    read = camera(json.dumps(known))
    assert (read.k, read.width, read.height, read.d) == (K, 640, 480, ())


@pytest.mark.parametrize("text", ["525 0 320\n0 520 240\n0 0 1\n", "525,0,320\n0,520,240\n0,0,1",
                                  "525 0 320 0\n0 520 240 0\n0 0 1 0\n0 0 0 1", "# fx fy cx cy\n525 520 320 240",
                                  "fx: 525\nfy: 520\ncx: 320\ncy: 240",
                                  '{"camera": {"fx": 525, "fy": 520, "cx": 320, "cy": 240}}'])  # fmt: skip
def test_bare_numbers_and_names_fit_a_picture_of_any_size(text: str) -> None:
    assert (camera(text).k, camera(text).width) == (K, 0)


def test_a_fish_eye_stays_one() -> None:
    fish = KALIBR.replace("radtan", "equidistant")
    assert camera(fish).distortion_model == "equidistant"
    kannala = ORB.format("Camera1").replace("PinHole", "KannalaBrandt8") + "Camera1.k3: 0.3\nCamera1.k4: 0.4\n"
    assert (camera(kannala).distortion_model, camera(kannala).d) == ("equidistant", (0.1, -0.2, 0.3, 0.4))


def test_of_several_cameras_of_kalibr_the_first_is_taken_and_said(tmp_path: Path) -> None:
    file = tmp_path / "chain.yaml"
    file.write_text(KALIBR + KALIBR.replace("cam0", "cam1").replace("525.0", "400.0"))
    read, (note,) = read_camera(str(file))
    assert read.k == K and read_calibration(str(file)) == read
    assert note.startswith("chain.yaml: the file has several cameras: cam0 is used, and not cam1")


def test_the_steps_of_depth_are_given_beside_the_camera() -> None:
    orb = ORB.format("Camera")
    assert parse_camera(orb + "RGBD.DepthMapFactor: 5208.0\n").depth_scale == 5208
    assert parse_camera(orb + "DepthMapFactor: 1000.0\n").depth_scale == 1000
    assert parse_camera(orb + "DepthMapFactor: 1.0\n").depth_scale is None
    assert parse_camera(json.dumps({**OPEN3D, "depth_scale": 1000.0})).depth_scale == 1000
    assert parse_camera(ROS).depth_scale is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1", "expected a file of ROS .*, got the keys a"),
        ("[1, 2]", "expected a file of ROS .*, got list"),
        ("", "expected a file of ROS .*, got NoneType"),
        ("a: [", "expected YAML, got"),
        ("%YAML:1.0\n---\na: [", "expected"),
        (KALIBR.replace("pinhole", "omni"), "expected cam0 with camera_model pinhole.*got omni"),
        (KALIBR.replace("[640, 480]", "640"), "expected resolution"),
        (ECHO.replace("  width: 0", "  width: 320"), "expected a camera_info of the whole picture, got roi"),
        (ECHO.replace("binning_x: 0", "binning_x: 2"), r"got roi \{\} and binning \[2\]"),
        (ORB.format("Camera").replace("Camera.cy", "Camera.c"), "got none for cy"),
        (OST.replace("0.0 520.0 240.0\n0.0 0.0 1.0\n\ndist", "dist"), "expected 9 numbers in camera_matrix, got 3"),
        ("{" * 5000, "expected"),
        ("<?xml version='1.0'?><a/>", "expected"),
    ],
)
def test_what_is_no_camera_is_refused(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        camera(text)
