# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bridge.trees import said, transform
from recording.sample_folders import CAMERA, records, uncalibrated
from recording.vision import detected
from simple_stages import OneBox, simple_stages

from objreg_ros import pipeline
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.messages import headers, motion_from_msg
from objreg_ros.data.closures import LoopClosure, Rejected, Relocalised
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import ColourImage, DepthImage, Detections, Intrinsics
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.geometry import back_project, pose, quaternion_from_rotation, rotation_angle, rotation_from_vector
from objreg_ros.params import FramesParams
from objreg_ros.segmenter.params import SegmenterNodeParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.sensor.sensor_estimate import Lag, SensorEstimate
from objreg_tools.offline.line import LineParams, as_sent, run_offline
from objreg_tools.recording import Record
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import TRANSFORMS
from objreg_tools.recording.recorded_detections import RecordedDetections
from objreg_tools.recording.rosbag import messages
from objreg_tools.truth import Truth

INPUTS = Inputs(image="/image", depth="/depth/image", camera_info="/camera_info", odom="/odom")
MS = 1_000_000


def test_every_frame_goes_through_with_its_odometry() -> None:
    stages, chain = simple_stages()
    run = run_offline(records(4), stages, INPUTS)
    assert (run.frames, run.detections, run.objects, len(run.closures)) == (4, 4, 4, 3)
    assert [frame.T_odom_camera[0, 3] for frame in chain.frames] == pytest.approx([0, 0.1, 0.2, 0.3])
    assert chain.finished and not run.dropped


def test_colour_reaches_the_segmenter_registered_to_depth() -> None:
    stages, chain = simple_stages()
    run_offline(records(3), stages, INPUTS)
    assert [frame.objects[0].rgb.tolist() for frame in chain.frames] == [[[i, 20, 30]] for i in range(3)]
    assert [round(float(frame.objects[0].xyz[0, 2]), 3) for frame in chain.frames] == [1.0, 1.001, 1.002]


@pytest.mark.parametrize("topic", ["/yolo/detections", "/yolo/instance_masks"])
def test_recorded_detections_take_the_place_of_the_detector(topic: str) -> None:
    stages, chain = simple_stages()
    recorded = RecordedDetections(topic, "/yolo/label_info")
    run = run_offline(detected(4), stages, INPUTS, recorded=recorded)
    assert (run.frames, run.detections, run.objects) == (4, 4, 4) and not run.dropped
    assert [row["labels"] for row in run.glimpses] == [["mug"]] * 4
    assert "detect" not in run.stage_s and chain.frames[1].T_odom_camera is not None
    without = run_offline(detected(4), simple_stages()[0], INPUTS, recorded=RecordedDetections(topic))
    assert without.frames == 4 and without.glimpses[0]["labels"] != ["mug"]


def test_recorded_boxes_and_masks_are_those_of_their_picture() -> None:
    for topic in ("/yolo/detections", "/yolo/instance_masks"):
        stages, _ = simple_stages()
        segmented: list[Detections] = []
        segment = stages.segmenter.segment

        def seen(found: Detections, *rest: Any, into: list = segmented, then: Any = segment, **more: Any) -> Frame:
            into.append(found)
            return then(found, *rest, **more)

        stages.segmenter.segment = seen  # type: ignore[method-assign]
        run_offline(detected(3), stages, INPUTS, recorded=RecordedDetections(topic))
        assert [found.xyxy.tolist() for found in segmented] == [[[20, 12, 40, 24]]] * 3
        assert {found.image_hw for found in segmented} == {(48, 64)}
        assert [found.instances is not None for found in segmented] == [topic.endswith("masks")] * 3


def test_a_picture_whose_recorded_detections_are_missing_or_broken_is_dropped_with_a_reason() -> None:
    there = [r for r in detected(4) if (r.topic, r.stamp_ns) != ("/yolo/detections", 1350 * MS)]
    broken = next(r for r in there if r.topic == "/yolo/detections").message
    broken.detections[0].bbox.size_x = -1.0
    there = [
        Record.of(r.topic, broken, r.stamp_ns) if r.stamp_ns == 1250 * MS and "detec" in r.topic else r for r in there
    ]
    run = run_offline(there, simple_stages()[0], INPUTS, recorded=RecordedDetections("/yolo/detections"))
    assert run.frames == 2 and run.dropped == {"malformed_detections": 1, "depth_unmatched": 2}
    assert "expected a finite box" in run.complaints["malformed_detections"]


def test_colour_can_be_left_out() -> None:
    stages, chain = simple_stages()
    run = run_offline(records(3), stages, INPUTS, LineParams(SegmenterNodeParams(colour=False)))
    assert run.frames == run.detections == 3
    assert [frame.objects[0].rgb for frame in chain.frames] == [None] * 3


def test_without_odometry_frames_go_through_without_it() -> None:
    stages, chain = simple_stages()
    run = run_offline(records(3), stages, Inputs(image="/image", depth="/depth/image", camera_info="/camera_info"))
    assert run.frames == 3 and all(frame.T_odom_camera is None for frame in chain.frames)
    assert run.rejected == {"no_candidate": 2}


def test_a_run_can_stop_early() -> None:
    stages, chain = simple_stages()
    run = run_offline(records(9), stages, INPUTS, max_frames=4)
    assert run.frames == len(chain.frames) == 4 and chain.finished


def at_30_hz(count: int, depth_late_ms: float = 0.0) -> list[Record]:
    """Pictures 33 ms apart, and depth that was exposed a little later."""
    found = []
    for record in records(count):
        k = (record.stamp_ns - 1000 * MS) // (100 * MS)
        late_ms = depth_late_ms if record.topic == "/depth/image" else 0.0
        stamp_ns = 1000 * MS + round((k * 1000 / 30 + late_ms) * MS)
        message = record.message
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        found.append(Record.of(record.topic, message, stamp_ns))
    return sorted(found, key=lambda record: record.stamp_ns)


@pytest.mark.parametrize("depth_late_ms", [0.0, 9.0, 15.0, -9.0])
def test_pictures_that_come_faster_than_they_are_wanted_are_surplus_with_their_depth(depth_late_ms: float) -> None:
    stages, chain = simple_stages()
    run = run_offline(at_30_hz(12, depth_late_ms), stages, INPUTS, LineParams(max_rate=10.0))
    taken = [round((frame.stamp_ns / MS - 1000 - depth_late_ms) * 30 / 1000) for frame in chain.frames]
    assert taken == [0, 3, 6, 9] and run.dropped == {"depth_surplus": 8}


def test_surplus_pictures_are_not_decoded() -> None:
    stages, _ = simple_stages()
    run = run_offline(at_30_hz(12), stages, INPUTS, LineParams(max_rate=10.0))
    assert len(run.stage_s["detect"]) == len(run.stage_s["segment"]) == 4


def without(topic: str, stamp_ns: int) -> Iterator[Record]:
    return (record for record in records(4) if (record.topic, record.stamp_ns) != (topic, stamp_ns))


def test_a_depth_image_without_colour_is_dropped_with_a_reason() -> None:
    stages, chain = simple_stages()
    run = run_offline(without("/image", 1100 * MS), stages, INPUTS)
    assert [frame.stamp_ns // MS for frame in chain.frames] == [1000, 1200, 1300]
    assert run.dropped == {"depth_unmatched": 1}


def test_frames_without_odometry_state_where_our_own_tracking_has_the_camera() -> None:
    stages, _ = simple_stages()
    run = run_offline(records(3), stages, Inputs(image="/image", depth="/depth/image", camera_info="/camera_info"))
    assert [row["tracked"] for row in run.glimpses] == [{"session": 0, "T_session_camera": np.eye(4).tolist()}] * 3
    assert not any("tracked" in row for row in run_offline(records(3), simple_stages()[0], INPUTS).glimpses)


def test_a_frame_whose_odometry_was_lost_goes_through_without() -> None:
    stages, chain = simple_stages()
    run_offline(without("/odom", 1100 * MS), stages, INPUTS)
    assert [frame.T_odom_camera is None for frame in chain.frames] == [False, True, False, False]


def test_a_frame_between_two_odometry_messages_has_a_pose_between_theirs() -> None:
    stages, chain = simple_stages()
    wanted = {1000 * MS: 970, 1100 * MS: 1070, 1200 * MS: 1170, 1300 * MS: 1270}  # each 30 ms before its frame
    shifted = []
    for record in records(4):
        if record.topic == "/odom":
            early = wanted[record.stamp_ns] * MS
            message = messages.odometry(
                motion_from_msg.odometry(record.message).T_odom_body, np.eye(6), early, "odom", "camera"
            )
            record = Record.of("/odom", message, early)
        shifted.append(record)
    run_offline(sorted(shifted, key=lambda record: record.stamp_ns), stages, INPUTS)
    assert [frame.T_odom_camera[0, 3] for frame in chain.frames[:3]] == pytest.approx([0.03, 0.13, 0.23])
    assert chain.frames[3].T_odom_camera is None  # nothing came after it, and the last is more than 20 ms away


def test_the_mounting_of_the_camera_is_applied() -> None:
    stages, chain = simple_stages()
    T_base_camera = np.eye(4)
    T_base_camera[2, 3] = 0.7
    run_offline(
        records(2), stages, INPUTS, LineParams(registrar=FramesParams(T_base_camera=as_parameter(T_base_camera)))
    )
    assert [frame.T_odom_camera[2, 3] for frame in chain.frames] == [0.7, 0.7]


def test_gravity_comes_from_a_level_odometry_where_there_is_one() -> None:
    stages, chain = simple_stages()
    looking_along_x = pose(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3))
    T_level_camera = as_parameter(looking_along_x @ turned_about_x(np.radians(30.0)))
    timing = LineParams(SegmenterNodeParams(level_odom=True, T_base_camera=T_level_camera))
    run_offline(without("/odom", 1100 * MS), stages, INPUTS, timing)
    tilted = [0, np.cos(np.radians(30)), -np.sin(np.radians(30))]
    for frame, expected in zip(chain.frames, (tilted, [0, 1, 0], tilted, tilted), strict=True):
        np.testing.assert_allclose(frame.gravity, expected, atol=1e-6)


def felt(degrees: float, frame_id: str = "camera") -> Iterator[Record]:
    """`records`, and a still IMU that is tilted by an angle about x, 50 times a second."""
    up = turned_about_x(np.radians(degrees))[:3, :3] @ np.array([0.0, -9.8, 0.0])
    stamps = range(800 * MS, 1400 * MS, 20 * MS)
    samples = [Record.of("/imu", messages.imu(up, (1e-6, 0, 0), s, frame_id), s) for s in stamps]
    yield from sorted([*records(4), *samples], key=lambda record: record.stamp_ns)


def test_gravity_comes_from_an_imu_in_the_cameras_frame_with_how_sure_it_is() -> None:
    stages, chain = simple_stages()
    run_offline(felt(30.0), stages, replace(INPUTS, imu="/imu"))
    assert len(chain.frames) == 4
    for frame in chain.frames:
        expected = [0, np.cos(np.radians(30)), np.sin(np.radians(30))]
        np.testing.assert_allclose(frame.gravity, expected, atol=1e-4)
    assert 1.0 < stages.segmenter.received_sigma_deg[-1] < stages.segmenter.received_sigma_deg[0] < 3.1


def test_the_mounting_of_the_imu_is_applied_and_without_one_it_gives_nothing() -> None:
    stages, chain = simple_stages()
    timing = LineParams(SegmenterNodeParams(T_camera_imu=as_parameter(turned_about_x(np.radians(-30.0)))))
    run_offline(felt(30.0, "imu"), stages, replace(INPUTS, imu="/imu"), timing)
    for frame in chain.frames:
        np.testing.assert_allclose(frame.gravity, [0, 1, 0], atol=1e-4)
    stages, chain = simple_stages()
    run = run_offline(felt(30.0, "imu"), stages, replace(INPUTS, imu="/imu"))
    assert stages.segmenter.received_sigma_deg == [None] * 4 and run.frames == 4
    assert run.summary(Truth([]))["gravity"]["imu_passed_over"] == {"unknown_frame": 4}


def test_an_imu_that_measures_nonsense_ends_nothing_and_is_counted() -> None:
    stages, _ = simple_stages()
    nan = Record.of("/imu", messages.imu((np.nan, 0, 0), None, 1050 * MS, "camera"), 1050 * MS)
    zero = Record.of("/imu", messages.imu((0, 0, 0), None, 1060 * MS, "camera"), 1060 * MS)
    said = sorted([*records(4), nan, zero], key=lambda record: record.stamp_ns)
    run = run_offline(said, stages, replace(INPUTS, imu="/imu"))
    assert run.frames == 4 and run.dropped == {"malformed_imu": 1}
    assert run.gravity()["imu_passed_over"] == {"no_acceleration": 1}


def as_parameter(T: np.ndarray) -> tuple[float, ...]:
    return (*T[:3, 3].tolist(), *quaternion_from_rotation(T[:3, :3]).tolist())


def turned_about_x(angle: float) -> np.ndarray:
    return pose(rotation_from_vector(np.array([angle, 0.0, 0.0])), np.zeros(3))


def broken() -> Iterator[Record]:
    for record in records(3):
        message = record.message
        if record.stamp_ns == 1100 * MS and record.topic == "/depth/image":
            message.data = message.data[:-10]
        if record.stamp_ns == 1200 * MS and record.topic == "/image":
            message.encoding = "bayer"
        yield Record.of(record.topic, message, record.stamp_ns)


def test_broken_messages_are_counted_and_the_run_goes_on() -> None:
    stages, chain = simple_stages()
    run = run_offline(broken(), stages, INPUTS)
    assert len(chain.frames) == 1
    assert run.dropped == {"malformed_depth": 1, "malformed_image": 1, "depth_unmatched": 1}
    assert "got 'bayer'" in run.complaints["malformed_image"]


def undecodable(topic: str, stamp_ns: int) -> Iterator[Record]:
    def decode() -> None:
        raise ValueError("expected a whole bag")

    for record in records(4):
        broken = (record.topic, record.stamp_ns) == (topic, stamp_ns)
        yield replace(record, decode=decode) if broken else record


@pytest.mark.parametrize(
    ("topic", "frames", "dropped"),
    [
        ("/odom", 4, {"malformed_odom": 1}),
        ("/camera_info", 4, {"malformed_camera_info": 1}),
        ("/image", 3, {"malformed_image": 1, "depth_unmatched": 1}),
        ("/depth/image", 3, {"malformed_depth": 1}),
    ],
)
def test_a_message_that_does_not_decode_is_counted_and_the_run_goes_on(
    topic: str, frames: int, dropped: dict[str, int]
) -> None:
    stages, _ = simple_stages()
    run = run_offline(undecodable(topic, 1100 * MS), stages, INPUTS)
    assert (run.frames, run.dropped) == (frames, dropped)
    assert "expected a whole bag" in next(iter(run.complaints.values()))


def test_a_recording_that_breaks_off_ends_the_run() -> None:
    def breaking() -> Iterator[Record]:
        yield from records(2)
        raise ValueError("expected a whole bag")

    stages, _ = simple_stages()
    with pytest.raises(ValueError, match="expected a whole bag"):
        run_offline(breaking(), stages, INPUTS)


def lost() -> Iterator[Record]:
    """The second odometry message has a quaternion of zeros, as drivers send that have lost track."""
    for record in records(4):
        message = record.message
        if (record.topic, record.stamp_ns) == ("/odom", 1100 * MS):
            message.pose.pose.orientation.w = 0.0
        yield Record.of(record.topic, message, record.stamp_ns)


def test_an_odometry_that_is_no_pose_is_counted_and_its_frame_goes_through_without() -> None:
    stages, chain = simple_stages()
    run = run_offline(lost(), stages, INPUTS)
    assert [frame.T_odom_camera is None for frame in chain.frames] == [False, True, False, False]
    assert (run.frames, run.dropped) == (4, {"malformed_odom": 1})
    assert "quaternion of non-zero length" in run.complaints["malformed_odom"]


def test_a_bug_in_a_stage_is_not_taken_for_a_broken_message() -> None:
    stages, chain = simple_stages()

    def fail(frame: object) -> None:
        raise ValueError("a bug")

    chain.process = fail  # type: ignore[method-assign, assignment]
    with pytest.raises(ValueError, match="a bug"):
        run_offline(records(2), stages, INPUTS)


def test_the_same_recording_gives_the_same_json() -> None:
    truth = Truth([(10**9, np.eye(4)), (11 * 10**8, np.eye(4))])
    texts = []
    for _ in range(2):
        stages, _ = simple_stages()
        summary = run_offline(records(4), stages, INPUTS).summary(truth)
        assert set(summary.pop("stage_ms")) == {"decode", "detect", "segment", "check", "register"}
        texts.append(json.dumps(summary))
    assert texts[0] == texts[1]


def test_the_json_has_the_keys_that_others_rely_on() -> None:
    stages, _ = simple_stages()
    summary = run_offline(records(4), stages, INPUTS).summary(Truth([(10**9, np.eye(4)), (11 * 10**8, np.eye(4))]))
    wanted = {"frames", "detections", "objects", "constraints", "rejected", "stage_ms", "truth"}
    assert wanted <= set(summary)
    wanted = {field.name for field in fields(LoopClosure)} | {"error"}
    assert set(summary["constraints"][0]) == wanted
    assert summary["constraints"][0]["error"] == pytest.approx({"rotation_deg": 0, "translation_cm": 10})
    others = [stated["error"] for stated in summary["constraints"][1:]]
    assert others and not any(others)
    assert summary["truth"]["count"] == 1 and summary["truth"]["translation_cm"]["max"] == pytest.approx(10)


def test_where_the_camera_is_in_an_earlier_map_is_in_the_json_since_when_it_was_known() -> None:
    stages, chain = simple_stages()
    process, later = chain.process, np.eye(4)
    later[0, 3] = 2.0

    def place(frame: Frame) -> Any:
        known = Relocalised(
            stamp_ns=frame.stamp_ns,
            session=3,
            target_ns=7,
            T_map_odom=np.eye(4),
            T_map_camera=later,
            covariance=np.eye(6),
            closures=2,
        )
        chain.relocalised = known if len(chain.frames) == 1 else None  # the second frame, and forgotten after it
        return process(frame)

    chain.process = place  # type: ignore[method-assign]
    summary = run_offline(records(4), stages, INPUTS).summary(Truth([]))
    assert summary["stored"] == {"before": {"keyframes": 0}, "after": {"keyframes": 4}}
    assert summary["whereabouts"] == "no closure to an earlier session yet"
    stated = summary["relocalised"]
    assert (stated["session"], stated["target_ns"], stated["closures"]) == (3, 7, 2)
    assert stated["first_ns"] == stated["stamp_ns"] == chain.frames[1].stamp_ns and stated["T_map_camera"][0][3] == 2.0
    assert json.loads(json.dumps(stated)) == stated


def test_where_nothing_is_known_of_an_earlier_map_the_json_has_none() -> None:
    stages, _ = simple_stages()
    assert run_offline(records(2), stages, INPUTS).summary(Truth([]))["relocalised"] is None


def test_what_the_wire_rounds_is_rounded() -> None:
    stages, chain = simple_stages()
    run_offline(records(1), stages, INPUTS)
    frame = chain.frames[0]
    assert frame.objects[0].density == float(np.float32(0.1)) != 0.1
    again = as_sent(frame)
    assert np.array_equal(again.gravity, frame.gravity) and again.gravity_confidence == frame.gravity_confidence


def test_points_go_through_the_organiser(monkeypatch: pytest.MonkeyPatch) -> None:
    stages, _ = simple_stages()
    rows = np.zeros((48, 64), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    rows["z"] = 2
    seen = []

    def organise(cloud, camera):  # type: ignore[no-untyped-def]
        seen.append(camera)
        depth = np.ascontiguousarray(cloud.xyz[..., 2])
        return DepthImage(depth=depth, rgb=None, intrinsics=CAMERA, stamp_ns=cloud.stamp_ns)

    monkeypatch.setattr(pipeline, "organise", organise)
    clouds = [r for r in records(2) if r.topic != "/depth/image"]
    for stamp_ns in (10**9, 11 * 10**8):
        clouds.append(Record.of("/points", messages.point_cloud(rows, stamp_ns, "camera"), stamp_ns))
    run = run_offline(clouds, stages, Inputs(image="/image", points="/points", camera_info="/camera_info"))
    assert run.frames == 2 and seen[0].fx == CAMERA.fx


@pytest.mark.parametrize(("height", "frames"), [(48, 2), (1, 0)])
def test_a_camera_that_is_not_calibrated_stops_only_clouds_that_need_one(height: int, frames: int) -> None:
    stages, _ = simple_stages()
    xyz = back_project(1.5 + np.random.default_rng(1).random((48, 64)), 50.0, 50.0, 31.5, 23.5)
    rows = np.zeros((48, 64), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    for axis, name in enumerate("xyz"):
        rows[name] = xyz[..., axis]
    said = [r for r in records(2) if r.topic == "/image"]
    for stamp_ns in (10**9, 11 * 10**8):
        cloud = messages.point_cloud(rows.reshape(height, -1), stamp_ns, "camera")
        said.append(uncalibrated(stamp_ns))
        said.append(Record.of("/points", cloud, stamp_ns))
    run = run_offline(said, stages, Inputs(image="/image", points="/points", camera_info="/camera_info"))
    assert run.frames == frames and run.dropped == ({} if frames else {"malformed_camera_info": 2})
    assert frames or "expected a calibrated K" in run.complaints["malformed_camera_info"]


def test_the_json_has_every_frame_and_where_its_objects_are() -> None:
    stages, _ = simple_stages()
    run = run_offline(records(4), stages, INPUTS)
    summary = json.loads(json.dumps(run.summary(Truth([]))))
    assert [row["T_odom_camera"][0][3] for row in summary["glimpses"]] == pytest.approx([0, 0.1, 0.2, 0.3])
    assert summary["glimpses"][2]["labels"] == ["cup"]
    assert summary["glimpses"][2]["objects"] == [["cup", [0.0, 0.0, 1.002]]]


def test_the_json_has_every_refusal() -> None:
    stages, _ = simple_stages()
    run = run_offline(without("/odom", 1100 * MS), stages, INPUTS)
    expected = {"reason": "no_candidate", "from_ns": 1100 * MS, "to_ns": 1200 * MS, "detail": "no odometry"}
    stated = run.summary(Truth([]))["refusals"][1]
    assert expected.items() <= stated.items() and set(stated) == {field.name for field in fields(Rejected)}


def of_a_lens(frames: int, model: str = "plumb_bob", **names: str) -> Iterator[Record]:
    """The records, with a camera_info that states a lens; ``names`` call topics otherwise."""
    for record in records(frames):
        message = record.message
        if record.topic == "/camera_info":
            message = messages.camera_info(CAMERA, record.stamp_ns, "camera", (-0.3, 0.1, 0.0, 0.0, 0.0))
            message.distortion_model = model
        yield Record.of(names.get(record.topic[1:].replace("/", "_"), record.topic), message, record.stamp_ns)


def seen_of_a_lens(records: Iterator[Record], inputs: Inputs, rectified: str = "auto") -> tuple[Any, list[Any]]:
    """What a run gives, and the depth image and the box of each frame that reached the segmenter."""
    stages, _ = simple_stages()
    met: list[Any] = []

    def segment(detections: Detections, depth: DepthImage, gravity: Any = None, **more: Any) -> Frame:
        met.append((depth, detections.xyxy))
        return stages.segmenter.segment(detections, depth, gravity, **more)

    spied_segmenter = SimpleNamespace(segment=segment, choice=stages.segmenter.choice, sensor=stages.segmenter.sensor)
    spied = replace(stages, segmenter=spied_segmenter)
    return run_offline(records, spied, inputs, LineParams(SegmenterNodeParams(rectified=rectified))), met


def test_pictures_and_boxes_of_a_lens_reach_the_segmenter_rectified() -> None:
    straight, as_they_are = seen_of_a_lens(records(3), INPUTS)
    run, rectified = seen_of_a_lens(of_a_lens(3), INPUTS)
    assert run.frames == 3 and run.lens.startswith("plumb_bob, moves a pixel by ") and run.lens.endswith("; rectified")
    assert run.summary(Truth([]))["lens"] == run.lens and straight.lens == "none stated: taken as rectified"
    for (depth, box), (plain, stated) in zip(rectified, as_they_are, strict=True):
        assert depth.shown is not None and plain.shown is None and not np.array_equal(box, stated)


def test_pictures_whose_topics_say_that_they_are_rectified_reach_it_as_they_are() -> None:
    inputs = replace(INPUTS, image="/image_rect", depth="/depth/image_rect")
    renamed = of_a_lens(2, image="/image_rect", depth_image="/depth/image_rect")
    _, as_they_are = seen_of_a_lens(records(2), INPUTS)
    run, met = seen_of_a_lens(renamed, inputs)
    assert run.frames == 2 and "taken as rectified" in run.lens
    for (depth, box), (plain, stated) in zip(met, as_they_are, strict=True):
        assert np.array_equal(depth.depth, plain.depth) and np.array_equal(box, stated)
    again, met = seen_of_a_lens(of_a_lens(2), INPUTS, "all")
    assert "taken as rectified" in again.lens and met[0][0].shown is None


def test_frames_of_a_lens_that_nobody_knows_are_dropped_with_what_to_do() -> None:
    stages, chain = simple_stages()
    run = run_offline(of_a_lens(3, "nobody's"), stages, INPUTS)
    assert chain.frames == [] and run.dropped == {"malformed_depth": 3}
    assert 'got "nobody\'s"; set segmenter.rectified to all' in run.complaints["malformed_depth"]


def test_a_run_states_what_its_frames_show_of_their_sensor() -> None:
    stages, _ = simple_stages()
    sensor = SimpleNamespace(
        noise=1.234567, lag=Lag(24.0, 3.5), depth_to_colour=SimpleNamespace(text=lambda: "0.50 deg")
    )
    stated = SimpleNamespace(segment=stages.segmenter.segment, choice=stages.segmenter.choice, sensor=sensor)
    summary = run_offline(records(2), replace(stages, segmenter=stated), INPUTS).summary(Truth([]))
    assert summary["depth_noise"] == 1.235 and summary["depth_to_colour"] == "0.50 deg"
    assert summary["depth_lag"] == {"ms": 24.0, "sigma_ms": 3.5}


def test_a_run_whose_frames_show_nothing_of_their_sensor_states_none() -> None:
    stages, _ = simple_stages()
    stated = SimpleNamespace(segment=stages.segmenter.segment, choice=stages.segmenter.choice, sensor=SensorEstimate())
    summary = run_offline(records(2), replace(stages, segmenter=stated), INPUTS).summary(Truth([]))
    assert summary["depth_noise"] is None and summary["depth_lag"] is None


def tied(place: np.ndarray, parent: str = "base", child: str = "camera") -> LineParams:
    """One frame at a place on another, by a tree of frames."""
    tree = FrameTree()
    tree.add_transforms(said(transform(parent, child, place)))
    return LineParams(frames=tree)


def test_the_cameras_place_on_the_body_is_asked_for_by_the_names_of_their_frames_unless_it_is_given() -> None:
    place = turned_about_x(0.3)
    (stages, chain), (given_stages, given_chain) = simple_stages(), simple_stages()
    run = run_offline(map(other_body, records(2)), stages, INPUTS, tied(place))
    stated = replace(tied(np.eye(4)), registrar=FramesParams(T_base_camera=as_parameter(place)))
    run_offline(map(other_body, records(2)), given_stages, INPUTS, stated)
    assert "/tf_static has the camera's 'camera' on the odometry's 'base'" in run.mount
    for frame, other in zip(chain.frames, given_chain.frames, strict=True):
        np.testing.assert_allclose(frame.T_odom_camera, other.T_odom_camera, atol=1e-9)
        np.testing.assert_allclose(frame.T_odom_camera[:3, :3], place[:3, :3], atol=1e-9)


def test_gravity_of_a_level_odometry_is_turned_by_the_same_place() -> None:
    place = pose(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3))

    stages, chain = simple_stages()
    run_offline(
        map(other_body, records(2)),
        stages,
        INPUTS,
        replace(tied(place), segmenter=SegmenterNodeParams(level_odom=True)),
    )
    for frame in chain.frames:
        np.testing.assert_allclose(frame.gravity, [0, 1, 0], atol=1e-6)


def with_joint(recorded: list[Record], reaches: int) -> Iterator[Record]:
    """The records, behind each odometry a joint that turned since the last, up to one of them."""
    count = 0
    for record in recorded:
        yield other_body(record)
        if record.topic == "/odom" and count < reaches:
            stamp_ns = headers.stamp_ns(record.message)
            message = said(transform("base", "camera", turned_about_x(0.1 * count), stamp_ns))
            yield Record("/tf", TRANSFORMS, record.stamp_ns, lambda message=message: message, bytes)
            count += 1


def test_frames_wait_for_the_joint_that_carries_their_camera() -> None:
    stages, chain = simple_stages()
    run = run_offline(with_joint(list(records(4)), 4), stages, INPUTS)
    angles = [rotation_angle(frame.T_odom_camera[:3, :3]) for frame in chain.frames]
    assert angles[1:] == pytest.approx([0.1, 0.2, 0.3], abs=1e-9) and "by a joint, which is followed" in run.mount


def test_odometry_of_a_body_that_nothing_ties_to_the_camera_is_taken_as_the_cameras_and_said() -> None:
    stages, _ = simple_stages()
    run = run_offline(map(other_body, records(2)), stages, INPUTS)
    assert "the registrar measures it" in run.mount


def other_body(record: Record) -> Record:
    message = record.message
    if record.topic == "/odom":
        message.child_frame_id = "base"
    return Record.of(record.topic, message, record.stamp_ns)


def test_what_the_masks_of_a_model_cover_is_the_objects(tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    from detector.discs import require_objects, save_disc_model

    stages, chain = simple_stages()
    detector = Detector(DetectorParams(), save_disc_model(tmp_path / "m.onnx", (CAMERA.height, CAMERA.width)))
    run_offline(records(2), replace(stages, detector=detector, segmenter=Segmenter()), INPUTS)
    for frame in chain.frames:
        require_objects(CAMERA, frame.objects)


OF_COLOUR = Intrinsics(fx=100.0, fy=100.0, cx=63.5, cy=35.5, width=128, height=72)
ASIDE = pose(np.eye(3), np.array([-0.06, 0.0, 0.0]))
WITH_COLOUR = replace(INPUTS, colour_info="/colour/camera_info")


def of_two_sensors() -> Iterator[Record]:
    """Colour of twice the pixels beside depth, whose left third is nearer; the camera_info of colour comes last."""
    for record in records(3):
        message, stamp_ns = record.message, record.stamp_ns
        if record.topic == "/image":
            yield Record.of(
                "/image", messages.image(np.zeros((72, 128, 3), np.uint8), "rgb8", stamp_ns, "rgb"), stamp_ns
            )
            info = messages.camera_info(OF_COLOUR, stamp_ns, "rgb")
            yield Record.of("/colour/camera_info", info, stamp_ns)
        elif record.topic == "/depth/image":
            depth = np.full((48, 64), 2000, np.uint16)
            depth[:, :20] = 1000
            yield Record.of(record.topic, messages.image(depth, "16UC1", stamp_ns, "depth"), stamp_ns)
        else:
            message.header.frame_id = "depth" if record.topic == "/camera_info" else message.header.frame_id
            yield Record.of(record.topic, message, stamp_ns)


class InFrame:
    """`OneBox`, whose detections are in the frame of their picture."""

    def detect(self, image: ColourImage) -> Detections:
        return replace(OneBox().detect(image), frame_id=image.frame_id)


def test_depth_of_another_sensor_goes_to_the_segmenter_in_the_picture_of_colour() -> None:
    stages, chain = simple_stages()
    timing = tied(ASIDE, "rgb", "depth")
    run = run_offline(of_two_sensors(), replace(stages, detector=InFrame()), WITH_COLOUR, timing)
    assert run.frames == 3 and not run.dropped
    assert run.summary(Truth([]))["registered"].startswith("depth of 'depth' is registered here to colour of 'rgb'")
    for frame in chain.frames:
        assert (frame.view.intrinsics.width, frame.view.intrinsics.fx) == (64, 50.0)
        row = frame.view.xyz[18, :, 2]
        assert (row[:17] == 1.0).all() and (row[19:61] == 2.0).all()  # 3 px at 1 m, 1.5 at 2 m


@pytest.mark.parametrize(
    ("inputs", "lacks"),
    [(WITH_COLOUR, "/tf_static between the two frames, got"), (INPUTS, "and the camera_info of colour, got")],
)
def test_depth_that_cannot_be_registered_is_dropped_with_what_is_missing(inputs: Inputs, lacks: str) -> None:
    stages, _ = simple_stages()
    run = run_offline(of_two_sensors(), replace(stages, detector=InFrame()), inputs)
    assert run.frames == 0 and run.dropped == {"malformed_depth": 3}
    assert lacks in run.complaints["malformed_depth"] and "'rgb'" in run.complaints["malformed_depth"]


def test_a_cloud_of_a_body_is_turned_into_the_frame_of_the_picture() -> None:
    stages, chain = simple_stages()
    xyz = back_project(np.full((48, 64), 2.0, np.float32), CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    R_body_optical = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    rows = np.zeros((48, 64), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    rows["x"], rows["y"], rows["z"] = np.moveaxis(xyz @ R_body_optical.T, -1, 0)
    said = [
        Record.of("/points", messages.point_cloud(rows, r.stamp_ns, "zed"), r.stamp_ns)
        if r.topic == "/depth/image"
        else r
        for r in records(2)
    ]
    inputs = Inputs(image="/image", points="/points", odom="/odom")
    timing = tied(pose(R_body_optical.T, np.zeros(3)), "camera", "zed")
    run = run_offline(said, stages, inputs, timing)
    assert run.frames == 2 and not run.dropped
    np.testing.assert_allclose(chain.frames[0].view.xyz, xyz, atol=1e-5)
    run = run_offline(said, stages, inputs)
    assert run.frames == 0 and "publish /tf_static between its frame" in run.complaints["refused"]
