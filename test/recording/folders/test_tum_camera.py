# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_tools.recording.folders.tum_camera import TumCamera, camera_file, read_camera

WHOLE = "fx: 585\nfy: 580\ncx: 320\ncy: 240\ndepth_scale: 1000"


def camera(folder: Path, text: str | None, width: int = 640, height: int = 480) -> TumCamera:
    file = folder / "camera.yaml"
    if text is not None:
        file.write_text(text)
    return read_camera(file, width, height)


def pinhole(of: TumCamera) -> tuple[float, ...]:
    return of.intrinsics.fx, of.intrinsics.fy, of.intrinsics.cx, of.intrinsics.cy


def test_what_the_file_gives_is_taken_without_a_note(tmp_path: Path) -> None:
    read = camera(tmp_path, f"{WHOLE}\nwidth: 640\nheight: 480\ndistortion: [0.1, 0, 0, 0, 0.2]")
    assert pinhole(read) == (585, 580, 320, 240) and (read.intrinsics.width, read.intrinsics.height) == (640, 480)
    assert (read.depth_scale, read.distortion, read.notes) == (1000, (0.1, 0, 0, 0, 0.2), ())


@pytest.mark.parametrize("width", [640, 320, 1280])
def test_the_default_camera_sees_as_much_in_pictures_of_any_width(width: int, tmp_path: Path) -> None:
    read = camera(tmp_path, None, width, width * 3 // 4)
    share = width / 640
    assert pinhole(read) == (525 * share, 525 * share, 320 * share - 0.5, 240 * share - 0.5)
    (note,) = read.notes
    assert f"default camera is assumed (fx {525 * share:g}, fy " in note and "depth_scale 5000" in note


def test_what_the_file_lacks_is_assumed_and_said_each_by_name(tmp_path: Path) -> None:
    read = camera(tmp_path, "fx: 300\nfy: 300\ncx:\n", 320, 240)
    assert pinhole(read) == (300, 300, 159.5, 119.5) and read.depth_scale == 5000
    assert read.notes == (
        "camera.yaml does not give all of the camera, so this is assumed: cx 159.5, cy 119.5, depth_scale 5000",
    )


def test_what_nobody_knows_is_said(tmp_path: Path) -> None:
    assert camera(tmp_path, f"{WHOLE}\nmaker: Microsoft\n2: x").notes == (
        "camera.yaml: not known, and not used: maker, 2",
    )


@pytest.mark.parametrize(
    ("text", "got"), [("Camera.fx: 585.0\nDepthMapFactor: 1000", "none for fy, cx"), ("depth_scale: 1000", "the keys")]
)
def test_a_file_without_a_camera_is_refused_with_what_it_has(text: str, got: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=rf"expected .*fx, fy, cx and cy.*got {got}.*depth_scale.*remove the file"):
        camera(tmp_path, text)


def test_a_focal_length_below_0_is_that_of_rows_that_count_downwards(tmp_path: Path) -> None:
    read = camera(tmp_path, WHOLE.replace("fy: 580", "fy: -480"))
    assert pinhole(read) == (585, 480, 320, 240)
    assert "fy -480 is taken as 480" in read.notes[0]
    with pytest.raises(ValueError, match="expected focal lengths"):
        camera(tmp_path, WHOLE.replace("fx: 585", "fx: -585"))


def test_the_settings_of_orb_slam_give_the_depth_scale_too(tmp_path: Path) -> None:
    names = "Camera.fx: 481.2\nCamera.fy: -480.0\nCamera.cx: 319.5\nCamera.cy: 239.5\nDepthMapFactor: 5208.0\n"
    read = camera(tmp_path, f"%YAML:1.0\n---\n{names}")
    assert pinhole(read) == (481.2, 480, 319.5, 239.5) and read.depth_scale == 5208
    assert read.notes == ("camera.yaml: fy -480 is taken without its sign",)


@pytest.mark.parametrize("said", ["", "width: 1280\nheight: 960\n"])
def test_a_camera_of_larger_colour_is_scaled_to_depth_and_said(said: str, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(f"fx: 1050\nfy: 1050\ncx: 640.5\ncy: 480.5\ndepth_scale: 1000\n{said}")
    read = read_camera(file, 640, 480, (1280, 960))
    assert pinhole(read) == (525, 525, 320, 240) and read.size == (640, 480)
    assert read.notes == ("camera.yaml is of pictures of 1280 × 960: scaled to depth's 640 × 480",)


def test_a_camera_of_depth_beside_larger_colour_stays_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(WHOLE)
    read = read_camera(file, 640, 480, (1280, 960))
    assert pinhole(read) == (585, 580, 320, 240) and read.notes == ()
    assert read_camera(tmp_path / "none.yaml", 640, 480, (1280, 960)).intrinsics.fx == 525


def test_a_camera_of_another_shape_is_left_as_it_is(tmp_path: Path) -> None:
    assert camera(tmp_path, f"{WHOLE}\nwidth: 1280\nheight: 720").size == (1280, 720)


@pytest.mark.parametrize("name", ["camera.yml", "camera.json"])
def test_the_file_may_be_json_or_end_otherwise(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text('{"width": 640, "height": 480, "fx": 585, "fy": 580, "cx": 320, "cy": 240}')
    assert camera_file(tmp_path).name == name
    assert pinhole(read_camera(camera_file(tmp_path), 640, 480)) == (585, 580, 320, 240)


@pytest.mark.parametrize("value", ["0.1", "none", "{a: 1}", "[a, b]"])
def test_distortion_that_is_no_list_of_numbers_is_refused(value: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"camera\.yaml: expected numbers .* a list of them as distortion, got: "):
        camera(tmp_path, f"{WHOLE}\ndistortion: {value}")


def test_a_depth_scale_that_divides_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"depth_scale 0\.0, which is none above 0"):
        camera(tmp_path, "fx: 500\ndepth_scale: 0")


@pytest.mark.parametrize("text", ["fx: " + "[" * 5000, "fx: " + "9" * 5000, "fx: 2020-99-99", "fx: [\n- a\n b: ]"])
def test_yaml_that_nests_or_says_what_no_reader_takes_is_refused_in_one_line(text: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"camera\.yaml: expected YAML, got: ") as refusal:
        camera(tmp_path, text)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("value", ["[0.1, 0.2]", "[.nan, 0, 0, 0, 0]", "[0.1, 0, 0, 0, 0, 0.1]"])
def test_distortion_that_is_no_lens_of_a_plumb_bob_is_refused(value: str, tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match=r"camera\.yaml: .*expected (4, 5, 8, 12 or 14|finite) coefficients of plumb_bob, got"
    ):
        camera(tmp_path, f"{WHOLE}\ndistortion: {value}")


CALIBRATED = (
    "image_width: 640\nimage_height: 480\ncamera_name: kinect\n"
    "camera_matrix: {rows: 3, cols: 3, data: [585, 0, 320, 0, 580, 240, 0, 0, 1]}\n"
    "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0.2]}\n"
)


def test_a_file_of_camera_calibration_will_do_and_depth_scale_may_be_added(tmp_path: Path) -> None:
    read = camera(tmp_path, f"{CALIBRATED}depth_scale: 1000")
    assert pinhole(read) == (585, 580, 320, 240) and (read.intrinsics.width, read.intrinsics.height) == (640, 480)
    assert (read.depth_scale, read.distortion, read.notes) == (1000, (0.1, 0, 0, 0, 0.2), ())
    (note,) = camera(tmp_path, CALIBRATED).notes
    assert note.endswith("assumed: depth_scale 5000")


@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_a_calibration_of_eight_numbers_is_taken_by_either_name(model: str, tmp_path: Path) -> None:
    eight = (0.4, -2.5, 0.0005, -0.0003, 1.4, 0.3, -2.3, 1.3)
    text = CALIBRATED.replace("plumb_bob", model).replace("cols: 5, data: [0.1, 0, 0, 0, 0.2]", f"data: {list(eight)}")
    assert camera(tmp_path, text).distortion == eight


def test_a_calibration_that_is_none_or_of_a_lens_that_the_folder_cannot_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"camera\.yaml: expected 9 numbers in camera_matrix, got 8"):
        camera(tmp_path, CALIBRATED.replace("585, ", ""))
    fish = CALIBRATED.replace("plumb_bob", "equidistant").replace("0.1, 0, 0, 0, 0.2", "0.1, 0, 0, 0")
    with pytest.raises(ValueError, match="expected the model plumb_bob, got equidistant; name this file with --camera"):
        camera(tmp_path, fish)
