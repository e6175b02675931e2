# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from objreg_ros.bridge.camera.camera_checks import check_camera
from objreg_ros.data.images import Intrinsics
from objreg_tools.recording.rosbag import messages

KINECT = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480)


def info(camera: Intrinsics, p: Intrinsics | None = None) -> Any:
    """A CameraInfo of a camera; ``p`` is another one that its P has."""
    said = messages.camera_info(camera, 5, "camera")
    if p is None:
        return said
    return replace(said, p=messages.camera_info(p, 5, "camera").p)


def anchors(*cameras: Any, one_frame: bool = False) -> list[str]:
    return [finding.anchor for finding in check_camera(*cameras, one_frame=one_frame)]


def test_a_camera_as_drivers_write_it_has_no_finding() -> None:
    assert anchors(info(KINECT)) == [] and anchors(info(KINECT), info(KINECT), one_frame=True) == []


@pytest.mark.parametrize(
    "p",
    [
        replace(KINECT, fx=1050.0, fy=1050.0, cx=639.0, cy=479.0),  # of a picture of twice the size
        replace(KINECT, fx=130.0, fy=130.0, cx=160.0, cy=120.0),  # of a default camera
    ],
)
def test_matrices_that_disagree_without_a_distortion_are_found_and_the_one_used_is_named(p: Intrinsics) -> None:
    (finding,) = check_camera(info(KINECT, p))
    assert finding.anchor == "camera-matrices-disagree" and "K is used" in finding.text


@pytest.mark.parametrize(
    ("changes", "anchor"),
    [({"cx": 900.0}, "camera-principal-point"), ({"fx": 20.0, "fy": 20.0}, "camera-focal-length")],
)
def test_a_camera_that_cannot_be_is_found(changes: dict[str, float], anchor: str) -> None:
    assert anchors(info(replace(KINECT, **changes))) == [anchor]


def test_two_cameras_of_one_picture_disagree_only_where_depth_is_registered() -> None:
    depth = info(replace(KINECT, fx=570.0, fy=570.0))
    assert anchors(depth, info(KINECT), one_frame=True) == ["camera-disagrees"]
    assert anchors(depth, info(KINECT)) == []
    other_size = info(replace(KINECT, width=1280, height=960, fx=1050.0, fy=1050.0, cx=639.5, cy=479.5))
    assert anchors(info(KINECT), other_size, one_frame=True) == []
