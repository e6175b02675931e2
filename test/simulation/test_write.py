# SPDX-License-Identifier: Apache-2.0
"""Written recordings: topics, truth, and the same bytes from the same seed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.recording import open_recording
from objreg_tools.simulation.params import RigParams
from objreg_tools.simulation.scenarios import make_plan
from objreg_tools.simulation.sensors.camera import LENSES
from objreg_tools.simulation.truth import read_truth
from objreg_tools.simulation.write import Sensors, simulate, write_plan

SMALL = Sensors(intrinsics=Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120))
FRAMES = 4


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("simulated") / "loop"
    simulate(path, "loop", seed=8, frames=FRAMES, sensors=SMALL, points=True)
    return path


def test_a_recording_has_the_graphs_topics_once_per_frame(recorded: Path) -> None:
    with open_recording(recorded) as recording:
        counts = {name: topic.count for name, topic in recording.topics.items()}
    topics = ("/image", "/depth/image", "/camera_info", "/points", "/odom", "/ground_truth")
    assert counts == dict.fromkeys(topics, FRAMES)


def test_all_messages_of_a_frame_carry_its_time_and_their_frames(recorded: Path) -> None:
    truth = read_truth(recorded)
    stamps: dict[str, list[int]] = {}
    frames = {}
    with open_recording(recorded) as recording:
        for record in recording.records():
            header = record.message.header
            stamps.setdefault(record.topic, []).append(header.stamp.sec * 10**9 + header.stamp.nanosec)
            frames[record.topic] = header.frame_id
    assert all(times == [frame.stamp_ns for frame in truth.frames] for times in stamps.values())
    assert frames["/image"] == frames["/depth/image"] == frames["/points"] == "camera"
    assert frames["/odom"] == "odom" and frames["/ground_truth"] == "world"


def test_the_points_are_the_depth_image_seen_through_the_camera(recorded: Path) -> None:
    with open_recording(recorded) as recording:
        depth = next(recording.records(["/depth/image"])).message
        cloud = next(recording.records(["/points"])).message
    z_mm = np.frombuffer(depth.data.tobytes(), np.uint16).reshape(120, 160)
    points = np.frombuffer(cloud.data.tobytes(), np.float32).reshape(120, 160, 8)
    valid = z_mm > 0
    np.testing.assert_allclose(points[valid][:, 2], z_mm[valid] / 1000.0, atol=5.1e-4)
    rows, columns = np.nonzero(valid)
    np.testing.assert_allclose(points[valid][:, 0], (columns - 79.5) / 131.25 * points[valid][:, 2], atol=1e-4)
    np.testing.assert_allclose(points[valid][:, 1], (rows - 59.5) / 131.25 * points[valid][:, 2], atol=1e-4)
    assert np.isnan(points[~valid][:, :3]).all()


def test_the_truth_has_boxes_around_the_masks_and_poses_where_the_depth_is(recorded: Path) -> None:
    truth = read_truth(recorded)
    assert truth.scenario == "loop" and truth.seed == 8 and len(truth.frames) == FRAMES
    frame = truth.frames[0]
    mask = truth.mask(frame.stamp_ns)
    assert frame.seen
    for sight in frame.seen:
        rows, columns = np.nonzero(mask == sight.object.instance)
        assert sight.xyxy.tolist() == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert sight.T_camera_object[2, 3] > 0.1


def test_the_same_seed_writes_the_same_bytes(recorded: Path, tmp_path: Path) -> None:
    again = tmp_path / "loop"
    simulate(again, "loop", seed=8, frames=FRAMES, sensors=SMALL, points=True, threads=1)
    with open_recording(recorded) as one, open_recording(again) as two:
        for a, b in zip(one.records(), two.records(), strict=True):
            assert (a.topic, a.stamp_ns, a.cdr) == (b.topic, b.stamp_ns, b.cdr)
    for name in ("frames.jsonl", "masks.zip"):
        assert (recorded / "truth" / name).read_bytes() == (again / "truth" / name).read_bytes()


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bent") / "loop"
    rig = RigParams(distortion=LENSES["webcam"], lag_ms=20.0)
    simulate(path, "loop", seed=8, frames=FRAMES, sensors=replace(SMALL, rig=rig), points=True)
    return path


def test_the_camera_info_of_a_lens_has_its_distortion_and_the_stamps_do_not_show_the_lag(bent: Path) -> None:
    stamps: dict[str, list[int]] = {}
    with open_recording(bent) as recording:
        for record in recording.records(["/image", "/depth/image", "/camera_info"]):
            stamp = record.message.header.stamp
            stamps.setdefault(record.topic, []).append(stamp.sec * 10**9 + stamp.nanosec)
            if record.topic == "/camera_info":
                assert record.message.distortion_model == "plumb_bob"
                assert tuple(record.message.d) == LENSES["webcam"]
    assert stamps["/image"] == stamps["/depth/image"] == stamps["/camera_info"]


def test_the_points_of_a_lens_lie_on_its_bent_rays(bent: Path) -> None:
    with open_recording(bent) as recording:
        cloud = next(recording.records(["/points"])).message
    points = np.frombuffer(cloud.data.tobytes(), np.float32).reshape(120, 160, 8)[..., :3]
    rows, columns = np.nonzero(np.isfinite(points[..., 2]))
    i = SMALL.intrinsics
    K = np.array([[i.fx, 0, i.cx], [0, i.fy, i.cy], [0, 0, 1]])
    seen = cv2.projectPoints(
        points[rows, columns].astype(float), np.zeros(3), np.zeros(3), K, np.array(LENSES["webcam"])
    )
    np.testing.assert_allclose(seen[0].reshape(-1, 2), np.column_stack([columns, rows]), atol=0.05)


def test_a_rig_changes_the_pictures_and_not_the_truth(recorded: Path, bent: Path) -> None:
    plain, other = read_truth(recorded), read_truth(bent)
    for a, b in zip(plain.frames, other.frames, strict=True):
        np.testing.assert_allclose(a.T_world_camera, b.T_world_camera, atol=1e-12)
        assert [s.pixels for s in a.seen] == [s.pixels for s in b.seen]
    assert plain.sensors["rig"]["lag_ms"] == 0 and other.sensors["rig"]["lag_ms"] == 20.0
    assert plain.sensors["sensor"] == "structured light"


@pytest.fixture(scope="module")
def of_robots(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The same plan of two robots, of which the second begins seven seconds later."""
    plan, folder = make_plan("orbit", 1, frames=2), tmp_path_factory.mktemp("robots")
    for robot, start_ns in (("robot1", 0), ("robot2", 7 * 10**9)):
        write_plan(folder / robot, replace(plan, robot=robot, start_ns=start_ns), "orbit", 1, SMALL, points=True)
    return [folder / "robot1", folder / "robot2"]


def test_a_robots_frames_have_its_name_and_its_stamps_begin_when_it_does(of_robots: list[Path]) -> None:
    first, second = (read_truth(path) for path in of_robots)
    assert [b.stamp_ns - a.stamp_ns for a, b in zip(first.frames, second.frames, strict=True)] == [7 * 10**9] * 2
    with open_recording(of_robots[1]) as recording:
        frames = {record.topic: record.message.header.frame_id for record in recording.records()}
        child = next(recording.records(["/odom"])).message.child_frame_id
    assert frames.pop("/odom") == "robot2/odom" and frames.pop("/ground_truth") == "world"
    assert set(frames.values()) == {child} == {"robot2/camera"}


def test_another_robot_has_other_noise_and_another_odometry(of_robots: list[Path]) -> None:
    last = []
    for path in of_robots:
        with open_recording(path) as recording:
            last.append({record.topic: record.message for record in recording.records()})
    one, two = last
    assert repr(one["/ground_truth"].pose) == repr(two["/ground_truth"].pose)
    assert repr(one["/odom"].pose.pose) != repr(two["/odom"].pose.pose)
    assert not np.array_equal(one["/depth/image"].data, two["/depth/image"].data)


def test_colour_can_be_compressed(tmp_path: Path) -> None:
    simulate(tmp_path / "jpeg", "orbit", seed=1, frames=2, sensors=SMALL, jpeg=True)
    with open_recording(tmp_path / "jpeg") as recording:
        picture = next(recording.records(["/image/compressed"])).message
        assert "/image" not in recording.topics and "/points" not in recording.topics
    assert cv2.imdecode(np.frombuffer(picture.data.tobytes(), np.uint8), cv2.IMREAD_COLOR).shape == (120, 160, 3)


def test_a_folder_that_exists_is_refused_and_kept(recorded: Path) -> None:
    with pytest.raises(FileExistsError, match="expected a new folder"):
        simulate(recorded, "loop", frames=2, sensors=SMALL)
    assert read_truth(recorded).frames
