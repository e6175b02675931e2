# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from detector.tiny_model import save_constant_model, tf_outputs
from recording.sample_folders import lost, tum_folder

from objreg_tools.cli import group
from objreg_tools.cli.commands.offline import command
from objreg_tools.offline.run import Run
from objreg_tools.recording import Record, open_recording, write_rosbag2
from objreg_tools.recording.inputs import Inputs

KEYS = {"frames", "detections", "objects", "constraints", "rejected", "stage_ms", "truth"}


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A detector that sees one cup in the middle of every picture."""
    folder = tmp_path_factory.mktemp("model")
    (folder / "labelmap.txt").write_text("cup\ntv\n")
    return save_constant_model(folder / "tiny.onnx", tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9]))


def read(recording: Path) -> list[Record]:
    with open_recording(recording) as source:
        return list(source.records())


def unstamped(message: Any) -> Any:
    message.header.stamp.sec = message.header.stamp.nanosec = 0
    return message


def offline(*words: object) -> str:
    result = CliRunner().invoke(group, ["offline", *map(str, words)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_a_folder_goes_through_the_real_stages_and_gives_its_json(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=4), tmp_path / "out.json"
    output = offline(folder, "--model", model, "--json", file, "--set", "registrar.seed=7")
    assert "4 frames, 4 detections" in output and "preparing detector" in output
    summary = json.loads(file.read_text())
    assert set(summary) >= KEYS and summary["frames"] == 4 and summary["odometry"] == "tracked"
    about = summary["about"]
    assert about["params"] == {"detector.model": str(model), "registrar.seed": 7}
    assert about["model"]["name"] == model.name and about["recording"] == str(folder)
    assert summary["inputs"] == {
        **Inputs(image="/image", depth="/depth/image", camera_info="/camera_info").outright,
        "ground_truth": "/ground_truth",
    }
    assert summary["stage_ms"].keys() == {"decode", "detect", "segment", "check", "register"}


def test_what_is_odd_about_the_recording_and_its_truth_is_said(model: Path, tmp_path: Path) -> None:
    with (tum_folder(tmp_path, frames=2) / "groundtruth.txt").open("a") as file:
        file.write("\n0.3 nan nan nan 0 0 0 1")
    assert "! 1 of 3 poses of groundtruth.txt are none" in offline(tmp_path, "--model", model)
    write_rosbag2(tmp_path / "bag", [lost(r) if r.topic == "/ground_truth" else r for r in read(tmp_path)])
    assert "! 2 of 2 poses of the ground truth /ground_truth are none" in offline(tmp_path / "bag", "--model", model)


def test_frames_whose_stamps_stand_still_are_said(model: Path, tmp_path: Path) -> None:
    still = [Record.of(r.topic, unstamped(r.message), r.stamp_ns) for r in read(tum_folder(tmp_path / "tum"))]
    write_rosbag2(tmp_path / "bag", still)
    assert "! all frames have the stamp 0 ns, so none closes a loop" in offline(tmp_path / "bag", "--model", model)
    assert "all frames have" not in offline(tmp_path / "tum", "--model", model)


def test_a_broken_picture_costs_its_frame_and_not_the_run(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=4), tmp_path / "out.json"
    (folder / "depth/0.100000.png").write_bytes(b"no png")
    output = offline(folder, "--model", model, "--json", file)
    assert "3 frames" in output and "dropped malformed_depth: 1" in output and "0.100000.png: expected a" in output
    assert json.loads(file.read_text())["dropped"] == {"malformed_depth": 1}


def test_a_run_stops_early(model: Path, tmp_path: Path) -> None:
    assert "2 frames" in offline(tum_folder(tmp_path, frames=4), "--model", model, "--max-frames", 2)


def test_json_for_a_folder_that_is_not_there_is_refused_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"--json: expected an existing folder .*nowhere, got none"):
        offline(tmp_path / "no_recording", "--json", tmp_path / "nowhere" / "out.json")


def test_json_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda path, mode: path != tmp_path)  # root may write everywhere
    with pytest.raises(OSError, match=r"--json: expected permission to write .*out\.json"):
        offline(tmp_path / "no_recording", "--json", tmp_path / "out.json")


def test_drifting_odometry_is_named_in_the_json(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=3), tmp_path / "out.json"
    offline(folder, "--model", model, "--json", file, "--odometry", "drift:3")
    summary = json.loads(file.read_text())
    assert summary["odometry"] == "/drifting_odom"
    assert all(glimpse["T_odom_camera"] is not None for glimpse in summary["glimpses"])


def test_drifting_odometry_is_the_cameras_own_and_takes_no_mounting(model: Path, tmp_path: Path) -> None:
    mounted = [f"{stage}.T_base_camera=[0.3, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5]" for stage in ("registrar", "segmenter")]
    words = [word for change in (*mounted, "segmenter.level_odom=true") for word in ("--set", change)]
    folder, trajectories = tum_folder(tmp_path / "tum", frames=3), []
    for name, changes in (("plain", []), ("mounted", words)):
        file = tmp_path / f"{name}.json"
        output = offline(folder, "--model", model, "--json", file, "--odometry", "drift:3", *changes)
        trajectories.append([glimpse["T_odom_camera"] for glimpse in json.loads(file.read_text())["glimpses"]])
    assert trajectories[0] == trajectories[1] and len(trajectories[0]) == 3
    assert "! --odometry drift:3 is the camera's own and not level: T_base_camera" in output


@pytest.mark.parametrize("odometry", ["drift", "drift:", "drift:x", "drift:²", "drift:-1"])
def test_a_drift_without_a_seed_is_refused_before_anything_is_prepared(odometry: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="--odometry: expected drift: and a seed like drift:1"):
        offline(tmp_path / "no_recording", "--odometry", odometry)


def test_an_odometry_that_is_not_there_is_refused_with_what_it_may_be(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected a topic of /.*, or tf, tracked, none or drift:SEED, got '/oddom'"):
        offline(tum_folder(tmp_path), "--odometry", "/oddom")


def test_a_drift_away_from_no_truth_is_refused(model: Path, tmp_path: Path) -> None:
    (tum_folder(tmp_path) / "groundtruth.txt").unlink()
    with pytest.raises(ValueError, match="needs a ground truth, and there is none"):
        offline(tmp_path, "--model", model, "--odometry", "drift:1")


def test_what_is_missing_is_said_with_what_is_there(model: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected a colour image, got .*/depth/image \(sensor_msgs/msg/Image\)"):
        offline(tum_folder(tmp_path), "--model", model, "--remap", "image:=")


def test_a_model_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no_model"):
        offline(tum_folder(tmp_path), "--model", "no_model.onnx")


def test_a_parameter_reaches_its_stage(model: Path, tmp_path: Path) -> None:
    output = offline(tum_folder(tmp_path, frames=2), "--model", model, "--set", "detector.threshold=0.95")
    assert "2 frames, 0 detections, 0 objects" in output


def test_the_segmenters_source_chooses_the_depth(model: Path, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path, frames=2)
    assert "2 frames" in offline(folder, "--model", model, "--set", "segmenter.source=depth")
    with pytest.raises(ValueError, match=r"for segmenter\.source=points, got .*, or leave out segmenter\.source"):
        offline(folder, "--model", model, "--set", "segmenter.source=points")


def test_a_remap_against_the_segmenters_source_is_refused(model: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected no depth with segmenter\.source=points, got /depth/image"):
        words = ("--set", "segmenter.source=points", "--remap", "depth:=/depth/image")
        offline(tum_folder(tmp_path), "--model", model, *words)


@pytest.mark.parametrize("colour", [True, False])
def test_the_segmenters_colour_reaches_the_run(
    colour: bool, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list = []
    monkeypatch.setattr("objreg_tools.cli.recorded.run_offline", lambda *given: seen.append(given[3]) or Run())
    offline(tum_folder(tmp_path), "--model", model, "--set", f"segmenter.colour={str(colour).lower()}")
    assert seen[0].segmenter.colour is colour


def test_a_camera_that_is_given_takes_the_place_of_the_recordings_and_is_named_in_the_json(
    model: Path, tmp_path: Path
) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=2), tmp_path / "out.json"
    bare = tmp_path / "bare"
    write_rosbag2(bare, [r for r in read(folder) if r.topic != "/camera_info"])
    with pytest.raises(ValueError, match=r"expected the camera_info of the depth image \(or --camera fx,fy,cx,cy\)"):
        offline(bare, "--model", model)
    output = offline(bare, "--model", model, "--json", file, "--camera", "50,50,31.5,23.5")
    summary = json.loads(file.read_text())
    assert "2 frames" in output and summary["camera"] == "50,50,31.5,23.5"
    assert summary["inputs"]["camera_info"] == "/given/camera_info" and not summary["dropped"]
    assert "2 frames" in offline(folder, "--model", model, "--set", "segmenter.camera=100,100,63.5,47.5,128,96")
    with pytest.raises(ValueError, match="expected a picture of 640 × 360 or of that shape, got 64 × 48"):
        offline(folder, "--model", model, "--camera", "500,500,320,180,640,360")


def test_a_store_is_named_with_what_it_held_and_whether_the_camera_is_in_its_map(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=4), tmp_path / "out.json"
    words = (folder, "--model", model, "--json", file, "--set", f"registrar.store={tmp_path / 'place.db'}")
    first, second = offline(*words), offline(*words)
    assert f"store {tmp_path / 'place.db'}: 0 sessions, 0 keyframes" in first and "relocalised" not in first
    assert "place.db: 1 session, 2 keyframes" in second
    assert "not relocalised: no closure to an earlier session yet" in second
    summary = json.loads(file.read_text())
    assert summary["store"] == str(tmp_path / "place.db") and summary["stored"]["before"]["sessions"] == 1
    assert summary["relocalised"] is None and summary["whereabouts"]


def test_the_map_of_a_run_is_written(model: Path, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "tum", frames=6)
    tum, kitti, g2o, ply = (tmp_path / name for name in ("way.tum", "way.kitti", "graph.g2o", "map.ply"))
    words = ("--tum", tum, "--kitti", kitti, "--g2o", g2o, "--map", ply, "--voxel", 0.05)
    output = offline(folder, "--model", model, "--odometry", "drift:1", *words)
    assert [len(file.read_text().splitlines()) for file in (tum, kitti)] == [6, 6]
    assert tum.read_text().splitlines()[3].startswith("0.300000000 ")
    assert g2o.read_text().startswith("VERTEX_SE3:QUAT 0 ") and ply.read_bytes().startswith(b"ply\nformat binary")
    assert f"map: {tum}: 6 poses" in output and "one for each voxel of 5 cm" in output


def test_the_map_is_made_of_the_store_that_was_asked_for(model: Path, tmp_path: Path) -> None:
    words = ("--odometry", "drift:1", "--map", tmp_path / "map.ply", "--set", f"registrar.store={tmp_path / 'a.db'}")
    offline(tum_folder(tmp_path / "tum", frames=4), "--model", model, *words)
    assert (tmp_path / "map.ply").exists() and (tmp_path / "a.db").exists()


@pytest.mark.parametrize("option", ["--tum", "--kitti", "--g2o", "--map"])
def test_a_map_of_no_trajectory_is_refused_before_the_run(option: str, tmp_path: Path) -> None:
    words = (option, tmp_path / "out", "--odometry", "none")
    with pytest.raises(ValueError, match=rf"{option}: expected a trajectory, .* or one of /.* with --odometry TOPIC"):
        offline(tum_folder(tmp_path / "tum"), "--model", "no_model.onnx", *words)


def test_a_recording_without_odometry_has_the_trajectory_of_our_own_tracking(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=4), tmp_path / "out.json"
    files = {name: tmp_path / name for name in ("tum", "kitti", "g2o", "map")}
    words = [word for name, path in files.items() for word in (f"--{name}", path.with_suffix(".out"))]
    output = offline(folder, "--model", model, "--json", file, *words)
    assert output.count("! there is no odometry: the trajectory is that of the registrar's own tracking") == 1
    trajectory = json.loads(file.read_text())["trajectory"]
    assert trajectory["of"] == "tracked" and trajectory["frames"] + trajectory["frames_apart"] == 4
    assert f"trajectory (tracked): {trajectory['frames']} frames" in output
    assert len((tmp_path / "tum.out").read_text().splitlines()) == trajectory["frames"]
    assert all((tmp_path / f"{name}.out").stat().st_size for name in ("kitti", "g2o", "map"))


def test_the_error_of_a_trajectory_is_stated_before_and_after_it_is_corrected(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=4), tmp_path / "out.json"
    output = offline(folder, "--model", model, "--json", file, "--odometry", "drift:1")
    error = json.loads(file.read_text())["trajectory"]["error_cm"]
    assert 0.0 < error["before"] < 20.0 and error["after"] == pytest.approx(error["before"], abs=0.2)
    assert f"trajectory error: {error['before']:.1f} cm, corrected {error['after']:.1f} cm (RMS)" in output


def test_no_trajectory_is_asked_for_and_none_is_reported(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=2), tmp_path / "out.json"
    assert "trajectory" not in offline(folder, "--model", model, "--json", file, "--odometry", "none")
    summary = json.loads(file.read_text())
    assert summary["odometry"] is None and summary["trajectory"] is None


@pytest.mark.parametrize("option", ["--tum", "--kitti", "--g2o"])
def test_a_map_that_cannot_be_written_is_refused_before_the_run(option: str, tmp_path: Path) -> None:
    with pytest.raises(OSError, match=f"{option}: expected an existing folder .*nowhere, got none"):
        offline(tmp_path / "no_recording", option, tmp_path / "nowhere" / "out")


def test_a_voxel_of_no_size_is_refused_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"--voxel: expected voxels of 0\.001 to 10 m, got nan"):
        offline(tmp_path / "no_recording", "--map", tmp_path / "map.ply", "--voxel", "nan")


def test_a_run_is_written_for_foxglove(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=4), tmp_path / "run.mcap"
    output = offline(folder, "--model", model, "--mcap", file, "--odometry", "none")
    assert f"{file}: the trajectory (true), 0 closures, 4 frames with picture and cloud" in output
    assert {record.topic for record in read(file)} >= {"/trajectory/true", "/tf", "/camera/points"}


def test_a_run_of_which_no_frame_got_through_says_why_and_ends_with_three(model: Path, tmp_path: Path) -> None:
    folder, file = tum_folder(tmp_path / "tum", frames=3), tmp_path / "out.json"
    for picture in (folder / "depth").iterdir():
        picture.write_bytes(b"no png")
    words = [str(folder), "--model", str(model), "--json", str(file)]
    result = CliRunner().invoke(command, words, catch_exceptions=False, standalone_mode=False)
    assert result.return_value == 3 and "! no frame got through: 3 malformed_depth" in result.output
    assert json.loads(file.read_text())["findings"][0]["anchor"] == "no-frame-got-through"


def test_a_map_without_an_ending_is_a_folder_of_grid_cloud_and_landmarks(model: Path, tmp_path: Path) -> None:
    words = ("--odometry", "drift:1", "--map", tmp_path / "map", "--voxel", 0.05, "--band", 0.2, 1.0)
    output = offline(tum_folder(tmp_path / "tum", frames=4), "--model", model, *words)
    assert {"map.ply", "landmarks.json"} <= {file.name for file in (tmp_path / "map").iterdir()}
    assert f"map: {tmp_path / 'map' / 'landmarks.json'}: " in output


def test_a_folder_for_the_map_that_is_a_file_and_a_grid_that_is_none_are_refused_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "map").write_text("")
    with pytest.raises(ValueError, match=r"--map: expected a folder, or a file that ends with \.ply, got the file"):
        offline(tmp_path / "no_recording", "--map", tmp_path / "map")
    with pytest.raises(ValueError, match="--cell: expected"):
        offline(tmp_path / "no_recording", "--map", tmp_path / "other", "--cell", 0)
