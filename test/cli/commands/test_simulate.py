# SPDX-License-Identifier: Apache-2.0
"""The command that makes recordings."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from objreg_tools.cli import main
from objreg_tools.cli.commands.simulate import camera_of, command, distortion_of, sensors_of
from objreg_tools.simulation.sensors.camera import KINECT, LENSES
from objreg_tools.simulation.truth import read_truth


def test_the_command_writes_a_recording_and_says_what_it_is(tmp_path: Path) -> None:
    out = tmp_path / "bag"
    options = ["--scenario", "orbit", "--seed", "3", "--frames", "2", "--size", "160x120", "--jpeg"]
    result = CliRunner().invoke(command, [str(out), *options])
    assert result.exit_code == 0, result.output
    assert "orbit, seed 3, 2 frames" in result.output and " 0.0 Hz" not in result.output
    assert read_truth(out).intrinsics.width == 160


def test_each_of_several_robots_has_a_recording_of_its_own(tmp_path: Path) -> None:
    out = tmp_path / "bags"
    result = CliRunner().invoke(command, [str(out), "--scenario", "robots", "--frames", "2", "--size", "80x60"])
    assert result.exit_code == 0, result.output
    truths = [read_truth(out / name) for name in ("robot1", "robot2", "robot3")]
    starts = [truth.frames[0].stamp_ns for truth in truths]
    assert starts == sorted(set(starts)) and starts[1] < truths[0].frames[-1].stamp_ns
    assert truths[0].objects[0].keys() == truths[2].objects[0].keys()
    assert f"{out / 'robot3'}: robots, seed 0, 2 frames" in result.output
    assert result.output.endswith(f"next: objreg inspect {out / 'robot1'}\n")


def test_a_folder_that_exists_ends_with_one_line_and_exit_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main("simulate", str(tmp_path), "--frames", "2")
    error = capsys.readouterr().err
    assert end.value.code == 1 and error.count("\n") == 1 and "expected a new folder" in error


def test_a_named_camera_keeps_its_view_at_another_size() -> None:
    small = camera_of("kinect", "320x240")
    assert (small.width, small.fx) == (320, 262.5)
    assert -0.5 - small.cx == (-0.5 - KINECT.cx) / 2


def test_four_numbers_make_a_camera() -> None:
    camera = camera_of("500,510,319.5,239.5", None)
    assert (camera.fx, camera.fy, camera.width, camera.height) == (500.0, 510.0, 640, 480)


@pytest.mark.parametrize(("name", "size"), [("kinnect", None), ("1,2,3", None), ("kinect", "640"), ("kinect", "9x9")])
def test_a_camera_that_makes_no_sense_is_refused_with_what_was_expected(name: str, size: str | None) -> None:
    with pytest.raises(ValueError, match="expected"):
        camera_of(name, size)


def test_parameters_are_set_by_section_and_name() -> None:
    sensors = sensors_of(KINECT, False, ("depth.noise_floor=0.002", "colour.tint=1.1,1,0.9", "stress.occluders=3"))
    assert sensors.depth.noise_floor == 0.002
    assert sensors.colour.tint == (1.1, 1.0, 0.9)
    assert sensors.stress.occluders == 3


@pytest.mark.parametrize("setting", ["depth.noise=1", "depht.near=1", "depth.near", "depth.near=x", "depth.far=-1"])
def test_a_parameter_that_is_not_there_or_out_of_range_is_refused(setting: str) -> None:
    with pytest.raises(ValueError, match=r"expected|no parameter"):
        sensors_of(KINECT, False, (setting,))


def test_what_is_refused_is_named_by_its_section() -> None:
    with pytest.raises(ValueError, match=r"^--set depth: no parameter nois; there are noise_floor, "):
        sensors_of(KINECT, False, ("depth.nois=1",))
    with pytest.raises(ValueError, match=r"^--set depth: far: expected"):
        sensors_of(KINECT, False, ("depth.far=-1",))


def test_stress_makes_the_depth_worse() -> None:
    assert sensors_of(KINECT, True, ()).stress.warp > 0
    assert sensors_of(KINECT, True, ("stress.warp=0",)).stress.warp == 0


def test_the_list_of_parameters_needs_no_folder() -> None:
    result = CliRunner().invoke(command, ["--list"])
    assert result.exit_code == 0 and "odometry.turn_drift = 1.0" in result.output


@pytest.mark.parametrize("intrinsics", ["500,500,inf,240", "nan,500,320,240", "500,500,320", "wide"])
def test_intrinsics_that_are_no_numbers_are_refused(intrinsics: str) -> None:
    with pytest.raises(ValueError, match=f"intrinsics: expected kinect.* or fx,fy,cx,cy in pixels, got '{intrinsics}'"):
        camera_of(intrinsics, None)


def test_a_sensor_brings_its_camera_its_depth_and_what_is_said_of_its_rig_into_the_truth(tmp_path: Path) -> None:
    out = tmp_path / "bag"
    timed = ["--lag-ms", "25", "--rolling-ms", "20", "--blur-ms", "5"]
    built = ["--lens", "kinect_v1", "--misregistration-px", "3"]
    options = ["--sensor", "realsense_d435", "--frames", "2", "--size", "160x120", "--set", "depth.subpixel=0.2"]
    result = CliRunner().invoke(command, [str(out), *options, *timed, *built])
    assert result.exit_code == 0, result.output
    truth = read_truth(out)
    assert truth.intrinsics.fx == camera_of("realsense_d435", "160x120").fx
    sensors = truth.sensors
    assert sensors["sensor"] == "active stereo" and sensors["depth"]["subpixel"] == 0.2
    assert sensors["rig"] == {
        "distortion": list(LENSES["kinect_v1"]), "lag_ms": 25.0, "rolling_ms": 20.0, "blur_ms": 5.0,
        "misregistration_px": 3.0, "misregistration_deg": 0.0, "misregistration_mm": 0.0,
    }  # fmt: skip


def test_a_lens_is_a_name_or_its_numbers() -> None:
    assert distortion_of("kinect_v1") == "0.262383,-0.953104,-0.005358,0.002628,1.163314"
    assert distortion_of("0.1,0,0,0") == "0.1,0,0,0"
    for lens in ("round", "0.1,0,0", "0.1,0,0,nan", "0,0,0,0,0,0"):
        with pytest.raises(ValueError, match=r"lens: expected kinect_v1, webcam or k1,k2,p1,p2\[,k3\], got"):
            distortion_of(lens)


def test_a_sensor_that_there_is_not_and_a_parameter_of_another_are_refused() -> None:
    with pytest.raises(ValueError, match="sensor: expected one of kinect_v1, realsense_d435, azure_kinect, got 'eye'"):
        sensors_of(KINECT, False, (), "eye")
    with pytest.raises(ValueError, match="--set depth: no parameter quantum; there are subpixel"):
        sensors_of(KINECT, False, ("depth.quantum=0",), "realsense_d435")
    with pytest.raises(ValueError, match="--set rig: lag_ms: expected"):
        sensors_of(KINECT, False, ("rig.lag_ms=1000",))


def test_the_list_has_the_parameters_of_every_sensor() -> None:
    listed = CliRunner().invoke(command, ["--list"]).output
    assert "# depth of azure_kinect" in listed and "depth.subpixel = 0.08  [px]" in listed and "rig.lag_ms" in listed
