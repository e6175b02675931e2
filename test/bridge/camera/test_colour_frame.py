# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bridge.sample_messages import camera_info, image
from objreg_ros.bridge.camera import lenses
from objreg_ros.bridge.camera.colour_frame import Cameras, SeenFrame, depth_image, in_optical_frame, named_registered
from objreg_ros.data.images import PointCloud
from objreg_ros.geometry import inverse, pose, rotation_from_vector

R_BODY_OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
ASIDE = pose(np.eye(3), np.array([-0.1, 0.0, 0.0]))
TURNED = pose(R_BODY_OPTICAL.T, np.zeros(3))
FRAMES = {("colour", "depth"): ASIDE, ("colour", "name"): TURNED}


def info(f: float, width: int, height: int, **more: Any) -> SimpleNamespace:
    K = [f, 0.0, width / 2 - 0.5, 0.0, f, height / 2 - 0.5, 0.0, 0.0, 1.0]
    return camera_info(K, width, height, **more)


OF_DEPTH = info(60.0, 80, 60, frame_id="depth")
OF_COLOUR = info(150.0, 160, 90, frame_id="colour")


def seen(
    cameras: Cameras, frame_id: str = "depth", colour_hw: tuple[int, int] | None = (90, 160), known: bool = True
) -> SeenFrame:
    metres = np.full((60, 80), 2000, np.uint16)
    metres[:, :20] = 0
    colour = None if colour_hw is None else image(np.zeros((*colour_hw, 3), np.uint8), "rgb8", frame_id="colour")
    depth = image(metres, "16UC1", frame_id=frame_id)
    return depth_image(depth, cameras, colour, lambda a, b: FRAMES.get((a, b)) if known else None)


def test_depth_of_another_sensor_comes_in_the_frame_and_camera_of_colour() -> None:
    found = seen(Cameras(OF_DEPTH, OF_COLOUR))
    assert found.depth.frame_id == "colour" and found.camera_info is OF_COLOUR
    assert (found.depth.intrinsics.width, found.depth.intrinsics.height) == (64, 36)  # 150 px become 60
    assert found.depth.rgb is not None and found.depth.rgb.shape == (36, 64, 3)
    first = int(np.argmax(found.depth.depth[18] > 0))
    assert first == round(60 * ((19.5 - 39.5) / 60 - 0.05) + 31.5 + 0.5)  # where the first column that was measured is
    assert "'depth' is registered here to colour of 'colour', with -10.0 0.0 0.0 cm" in found.registered


def test_without_a_picture_the_camera_info_of_colour_says_where_depth_belongs() -> None:
    found = seen(Cameras(OF_DEPTH, OF_COLOUR), colour_hw=None)
    assert found.depth.rgb is None and found.depth.frame_id == "colour" and found.depth.intrinsics.width == 64


@pytest.mark.parametrize(
    ("cameras", "frame_id", "colour_hw"),
    [
        (Cameras(OF_DEPTH, info(60.0, 80, 60)), "colour", (60, 80)),  # one frame
        (Cameras(OF_DEPTH, info(90.0, 80, 60)), "colour", (60, 80)),
        (Cameras(OF_DEPTH), "depth", (60, 80)),  # colour's camera is not known
        (Cameras(OF_DEPTH, info(60.0, 80, 60)), "name", (60, 80)),  # a frame of a body: nothing but names differ
        (Cameras(OF_DEPTH, info(60.0, 80, 60)), "stranger", (60, 80)),
        (Cameras(OF_DEPTH, info(60.0, 80, 60), named=True), "depth", (60, 80)),
        (Cameras(OF_DEPTH, info(90.0, 80, 60), named=True), "stranger", (60, 80)),
        (Cameras(OF_DEPTH, info(120.0, 160, 120)), "stranger", (120, 160)),  # the same view, twice as fine
        (Cameras(OF_DEPTH), "stranger", (120, 160)),
        (Cameras(OF_DEPTH), "colour", (90, 160)),
        (Cameras(OF_DEPTH, info(0.0, 80, 60)), "depth", (60, 80)),  # not calibrated
    ],
)
def test_depth_that_counts_as_registered_stays_to_the_bit(
    cameras: Cameras, frame_id: str, colour_hw: tuple[int, int]
) -> None:
    found = seen(cameras, frame_id, colour_hw)
    assert (found.registered, found.camera_info, found.depth.frame_id) == ("", OF_DEPTH, frame_id)
    assert (found.depth.depth[:, 20:] == 2.0).all() and not found.depth.depth[:, :20].any()
    assert (found.depth.rgb is None) == (colour_hw != (60, 80))


def test_two_sensors_of_one_make_differ_by_their_frames() -> None:
    found = seen(Cameras(OF_DEPTH, info(60.0, 80, 60)), "depth", (60, 80))
    assert found.registered and found.depth.frame_id == "colour"
    assert int(np.argmax(found.depth.depth[30] > 0)) == 17  # 3 px at 2 m


def test_depth_of_fewer_pixels_in_the_frame_of_colour_gets_its_colour() -> None:
    found = seen(Cameras(OF_DEPTH, info(120.0, 160, 120)), "colour", (120, 160), known=False)
    assert found.registered and found.depth.rgb is not None and (found.depth.depth[:, 20:] == 2.0).all()


@pytest.mark.parametrize(
    ("cameras", "frame_id", "lacks"),
    [
        (Cameras(OF_DEPTH, OF_COLOUR), "stranger", "/tf_static between the two frames, got colour of 160 × 90 px"),
        (Cameras(OF_DEPTH), "stranger", "/tf_static between the two frames and the camera_info of colour"),
        (Cameras(OF_DEPTH), "depth", "the camera_info of colour, got"),
        (Cameras(OF_DEPTH, OF_COLOUR), "name", "two optical frames on /tf_static"),
        (Cameras(OF_DEPTH, OF_COLOUR), "", "/tf_static between the two frames"),
        (Cameras(OF_DEPTH, awaited=True), "depth", "the camera_info of colour before it"),
    ],
)
def test_what_is_missing_to_register_depth_is_said(cameras: Cameras, frame_id: str, lacks: str) -> None:
    with pytest.raises(ValueError, match=lacks) as raised:
        seen(cameras, frame_id)
    assert f"{frame_id!r}" in str(raised.value) and "'colour'" in str(raised.value)


def test_a_frame_that_came_before_the_camera_of_colour_is_not_taken_as_registered() -> None:
    with pytest.raises(ValueError, match="got none yet"):
        seen(Cameras(OF_DEPTH, awaited=True), "depth", (60, 80))
    assert seen(Cameras(OF_DEPTH, awaited=True), "colour", (60, 80)).registered == ""


def test_the_lens_of_colour_is_undone_and_boxes_are_in_that_picture() -> None:
    bent = info(150.0, 160, 90, frame_id="colour")
    bent.d, bent.distortion_model, bent.r = [-0.2, 0.02, 0.0, 0.0, 0.0], "plumb_bob", np.zeros(9)
    found = seen(Cameras(OF_DEPTH, bent))
    lens = lenses.lens_of(found.camera_info, found.raw)
    assert lens is not None and lens.camera.width == 160
    assert found.depth.intrinsics.fx == pytest.approx(60.0) and found.camera_info is bent
    rectified = lenses.Raw(depth=True, colour=False)
    metres, colour = np.full((60, 80), 2000, np.uint16), np.zeros((90, 160, 3), np.uint8)
    messages = (
        image(metres, "16UC1", frame_id="depth"),
        Cameras(OF_DEPTH, bent),
        image(colour, "rgb8", frame_id="colour"),
    )
    straight = depth_image(*messages, lambda a, b: FRAMES[a, b], rectified)
    assert lenses.lens_of(straight.camera_info, straight.raw) is None


@pytest.mark.parametrize(
    ("depth", "colour", "registered"),
    [
        ("/camera/aligned_depth_to_color/image_raw", "/camera/color/image_raw", True),
        ("/camera/depth_registered/image_raw", "/camera/rgb/image_raw", True),
        ("/depth_to_rgb/image_raw", "/rgb/image_raw", True),
        ("/depth/image_raw", "/rgb_to_depth/image_raw", True),
        ("/camera/depth/image_rect_raw", "/camera/color/image_raw", False),
        ("/camera/depth_unregistered/image_raw", "/camera/color/image_raw", False),
        (None, None, False),
    ],
)
def test_names_of_topics_say_what_is_registered(depth: str | None, colour: str | None, registered: bool) -> None:
    assert named_registered(depth, colour) is registered


def cloud(xyz: np.ndarray, frame_id: str) -> PointCloud:
    return PointCloud(xyz=xyz.astype(np.float32), rgb=None, stamp_ns=3, frame_id=frame_id)


def test_an_organised_cloud_of_a_bodys_frame_is_turned_and_keeps_its_pixels() -> None:
    v, u = np.mgrid[:6, :8]
    optical = np.stack([(u - 3.5) / 10 * 2.0, (v - 2.5) / 10 * 2.0, np.full(u.shape, 2.0)], axis=-1)
    optical[2, 3] = np.nan
    T_body_optical = pose(R_BODY_OPTICAL, np.array([0.1, 0.0, 0.3]))
    body = optical @ T_body_optical[:3, :3].T + T_body_optical[:3, 3]
    found = in_optical_frame(cloud(body, "/body"), "optical", lambda a, b: inverse(T_body_optical))
    assert found.frame_id == "optical" and found.organised
    np.testing.assert_allclose(found.xyz, optical, atol=1e-6)


def test_a_cloud_that_is_not_organised_is_moved_out_of_any_frame_that_is_tied_to_colour() -> None:
    points = np.array([[[0.0, 0.0, 2.0], [1.0, 0.0, 3.0]]])
    found = in_optical_frame(cloud(points, "depth"), "colour", lambda a, b: FRAMES[a, b])
    np.testing.assert_allclose(found.xyz, points - [0.1, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("frame_id", ["colour", "", "stranger", "depth"])
def test_other_clouds_stay_as_they_are(frame_id: str) -> None:
    given = cloud(np.ones((4, 5, 3)), frame_id)
    assert in_optical_frame(given, "colour", lambda a, b: FRAMES.get((a, b))) is given


def test_either_direction_of_an_edge_and_a_turn_between_the_sensors_give_one_picture() -> None:
    T = pose(rotation_from_vector(np.array([0.01, 0.03, -0.02])), np.array([0.03, -0.01, 0.005]))
    depth = image(np.full((60, 80), 2000, np.uint16), "16UC1", frame_id="depth")
    found = depth_image(depth, Cameras(OF_DEPTH, OF_COLOUR), None, lambda a, b: T if a == "colour" else inverse(T))
    y, x = np.nonzero(found.depth.depth)
    camera, z = found.depth.intrinsics, found.depth.depth[y, x]
    points = np.column_stack([(x - camera.cx) / camera.fx * z, (y - camera.cy) / camera.fy * z, z])
    back = (points - T[:3, 3]) @ T[:3, :3]
    assert len(z) > 1500
    np.testing.assert_allclose(back[:, 2], 2.0, atol=0.002)  # the wall that depth saw
