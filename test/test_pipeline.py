# SPDX-License-Identifier: Apache-2.0
"""Messages of one time through the pipeline, with a host that notes what is asked of it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bridge.trees import said, transform
from recording.sample_folders import CAMERA
from simple_stages import OneBox, OneCloud

from objreg_ros.bridge.camera.colour_frame import Cameras
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.lenses import Raw
from objreg_ros.bridge.streams.sync import Match
from objreg_ros.data.frames import FeltGravity
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.pipeline import ENOUGH_COMPARED, Host, Pipeline, Size
from objreg_ros.segmenter.gravity.gravity_choice import GravityChoice
from objreg_ros.segmenter.params import SegmenterNodeParams
from objreg_tools.recording.rosbag import messages

STAMP_NS = 1_000_000_000
DETECTED = replace(
    OneBox().detect(ColourImage(rgb=np.zeros((48, 64, 3), np.uint8), stamp_ns=STAMP_NS)), frame_id="camera"
)


class NotingHost:
    """Notes what it was given."""

    def __init__(self) -> None:
        self.sizes: list[tuple[Size, Size]] = []
        self.reminders: list[str] = []
        self.decoded: list[str] = []

    def read(self, topic: str, decode: Callable[..., Any], *of: Any) -> Any:
        self.decoded.append(topic)
        return decode(*of)

    def detections(self, match: Match, size: Size, size_of_picture: Size) -> Detections:
        self.sizes.append((size, size_of_picture))
        return DETECTED

    def host(self) -> Host:
        return Host(
            read=self.read,
            timed=lambda stage: nullcontext(),
            remind=lambda reason, text: self.reminders.append(reason),
            say=lambda text: None,
            detections=self.detections,
            most_pixels=100_000,
        )


def depth_match(**more: Any) -> Match:
    depth = messages.image(np.full((48, 64), 2000, np.uint16), "16UC1", STAMP_NS, "camera")
    info = messages.camera_info(CAMERA, STAMP_NS, "camera")
    return Match(STAMP_NS, {"depth": depth, "detections": DETECTED, "camera_info": info, **more})


def segmented(match: Match, noting: NotingHost, segmenter: Any = None, **inputs: Any) -> Any:
    pipeline = Pipeline(segmenter or OneCloud(), SegmenterNodeParams(**inputs), FrameTree(), noting.host())
    return pipeline.segment(match, Cameras(match.payloads.get("camera_info")), Raw())


def test_depth_with_its_camera_becomes_a_frame_and_says_what_it_was_made_of() -> None:
    made = segmented(depth_match(), noting := NotingHost())
    assert made.frame.objects[0].xyz[0, 2] == 2.0 and made.detections.label == ("cup",)
    assert made.lens == "none stated: taken as rectified" and made.seen.registered == ""
    assert noting.decoded.count("depth") == 1 and noting.reminders == []
    assert noting.sizes == [((48, 64), (48, 64))]


@pytest.mark.parametrize(
    ("image", "expected"),
    [
        (None, (48, 64)),
        (SimpleNamespace(encoding="rgb8", height=120, width=160), (120, 160)),
        (ColourImage(rgb=np.zeros((90, 120, 3), np.uint8), stamp_ns=STAMP_NS), (90, 120)),
    ],
    ids=["without a picture: of the camera", "of a raw picture", "of a decoded picture"],
)
def test_foreign_boxes_are_of_the_size_of_their_picture(image: Any, expected: Size) -> None:
    cloud = messages.point_cloud(points(), STAMP_NS, "camera")
    match = Match(STAMP_NS, {"depth": cloud, "detections": DETECTED, "image": image})
    segmented(match, noting := NotingHost())
    assert noting.sizes == [((48, 64), expected)]


def points() -> np.ndarray:
    rows = np.zeros((48, 64), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    v, u = np.mgrid[:48, :64]
    rows["z"] = 2.0
    rows["x"], rows["y"] = (u - CAMERA.cx) * 2.0 / CAMERA.fx, (v - CAMERA.cy) * 2.0 / CAMERA.fy
    return rows


def test_a_message_that_breaks_its_contract_is_named_by_its_input() -> None:
    noting = NotingHost()
    depth = messages.image(np.zeros((48, 64, 3), np.uint8), "bgr8", STAMP_NS, "camera")
    with pytest.raises(ValueError, match="depth"):
        segmented(depth_match(depth=depth), noting)
    assert noting.decoded == ["depth"]


def test_gravity_of_an_imu_is_turned_into_the_camera_and_one_of_an_unknown_mount_is_reported() -> None:
    felt = FeltGravity(
        gravity=np.array([0.0, 0.0, -1.0]), gravity_sigma_deg=1.0, stamp_ns=STAMP_NS, frame_id="imu"
    )  # fmt: skip
    match, noting, tree = depth_match(imu=(felt,)), NotingHost(), FrameTree()
    tree.add_transforms(
        said(transform("camera", "imu", pose(rotation_from_vector(np.array([np.pi / 2, 0, 0])), np.zeros(3))))
    )
    pipeline = Pipeline(OneCloud(), SegmenterNodeParams(), tree, noting.host())
    frame = pipeline.segment(match, Cameras(match["camera_info"]), Raw()).frame
    np.testing.assert_allclose(frame.gravity, [0, 1, 0], atol=1e-9)
    assert noting.reminders == []
    segmented(match, noting)
    assert noting.reminders == ["imu_frame"]


def test_a_level_odometry_that_does_not_come_is_reported() -> None:
    segmented(depth_match(odom=None), noting := NotingHost(), level_odom=True)
    assert noting.reminders == ["level_odom"]


def test_an_imu_that_disagrees_with_most_pictures_is_reported() -> None:
    segmenter, noting = OneCloud(), NotingHost()
    segmenter.choice = GravityChoice(np.array([0.0, -1.0, 0.0]), 0.5, "imu", 40.0)
    pipeline, match = Pipeline(segmenter, SegmenterNodeParams(), FrameTree(), noting.host()), depth_match()
    for _ in range(ENOUGH_COMPARED):
        pipeline.segment(match, Cameras(match["camera_info"]), Raw())
    assert noting.reminders == ["imu_mounting"] and len(pipeline.apart_deg) == ENOUGH_COMPARED
