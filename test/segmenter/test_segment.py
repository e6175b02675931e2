# SPDX-License-Identifier: Apache-2.0
"""Whole frames of known shapes through the segmenter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.frames import UNNAMED, PointFlag
from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter

from .scenes import SMALL, Scene, two_boxes

NOISE = 0.0015


def test_two_boxes_on_a_table_are_found_whole_and_without_the_table() -> None:
    scene = two_boxes()
    frame = Segmenter().segment(scene.detections(scene.box_of(2), scene.box_of(3)), scene.image(NOISE))
    assert [o.instance for o in frame.objects] == [1, 2]
    assert [o.label for o in frame.objects] == ["0", "1"]
    assert scene.iou(frame.objects[0].xyz, 2) > 0.95
    assert scene.iou(frame.objects[1].xyz, 3) > 0.95


def test_gravity_is_the_way_things_fall() -> None:
    scene = two_boxes()
    frame = Segmenter().segment(scene.detections(), scene.image(NOISE))
    assert frame.gravity is not None
    assert np.degrees(np.arccos(-frame.gravity @ scene.up)) < 0.5
    assert frame.gravity_confidence > 0.9


@pytest.mark.parametrize("tilt", [5, 40, 72])
def test_gravity_is_found_however_steeply_the_camera_looks_down(tilt: float) -> None:
    scene = Scene(tilt_deg=tilt).plane().box((-0.1, 0.0, 0), (0.1, 0.1, 0.1))
    frame = Segmenter().segment(scene.detections(), scene.image(2 * NOISE))
    assert frame.gravity is not None
    assert np.degrees(np.arccos(-frame.gravity @ scene.up)) < 1.0


def test_a_given_gravity_is_handed_on_with_full_confidence() -> None:
    scene = two_boxes()
    frame = Segmenter().segment(scene.detections(scene.box_of(2)), scene.image(NOISE), gravity=-2 * scene.up)
    np.testing.assert_allclose(frame.gravity, -scene.up)
    assert frame.gravity_confidence == 1.0
    assert scene.iou(frame.objects[0].xyz, 2) > 0.95


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_camera_mounted_on_its_side_or_head_finds_the_same_by_its_roll(turns: int) -> None:
    scene = two_boxes()
    x0, y0, x1, y1 = scene.box_of(3)
    upright = scene.image(NOISE)
    whole = Segmenter().segment(scene.detections((x0, y0, x1, y1)), upright).objects[0]
    corners = np.array([(x0, y0), (x1, y1)])
    camera = scene.camera
    for _ in range(turns):  # of the camera, clockwise: the picture turns the other way
        corners = np.stack([corners[:, 1], camera.width - corners[:, 0]], axis=1)
        camera = Intrinsics(
            fx=camera.fy, fy=camera.fx, cx=camera.cy, cy=camera.width - 1 - camera.cx,
            width=camera.height, height=camera.width,
        )  # fmt: skip
    box = (*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist())
    image = DepthImage(depth=np.rot90(upright.depth, turns).copy(), rgb=None, intrinsics=camera, stamp_ns=7)
    asked = replace(scene.detections(box), image_hw=(camera.height, camera.width))
    frame = Segmenter(SegmenterParams(roll=90.0 * turns)).segment(asked, image)
    assert frame.gravity_confidence > 0.9
    assert abs(len(frame.objects[0]) / len(whole) - 1) < 0.03
    assert not frame.objects[0].has(PointFlag.UNSUPPORTED)


def test_a_gravity_without_direction_is_refused() -> None:
    with pytest.raises(ValueError, match="non-zero length"):
        Segmenter().segment(two_boxes().detections(), two_boxes().image(), gravity=np.zeros(3))


def test_boxes_of_a_larger_picture_are_scaled_to_the_depth_image() -> None:
    scene = Scene(SMALL).plane().box((-0.05, -0.05, 0), (0.05, 0.05, 0.15))
    box = scene.box_of(2)
    doubled = Detections(
        xyxy=2 * np.array([box], np.float32),
        score=np.ones(1, np.float32),
        label=("box",),
        image_hw=(480, 640),
        stamp_ns=0,
    )
    image = scene.image(NOISE)
    whole = Segmenter().segment(scene.detections(box), image).objects[0]
    np.testing.assert_array_equal(Segmenter().segment(doubled, image).objects[0].xyz, whole.xyz)


def test_normals_point_to_the_camera_and_colour_comes_from_the_pixel() -> None:
    scene = two_boxes()
    image = scene.image(0.0)
    thing = Segmenter().segment(scene.detections(scene.box_of(3)), image).objects[0]
    known = np.linalg.norm(thing.normals, axis=1) > 0
    assert known.mean() > 0.9
    assert ((thing.normals * thing.xyz).sum(axis=1)[known] < 0).all()
    top = thing.normals @ scene.up > 0.99
    assert top.mean() > 0.3
    assert thing.rgb is not None
    assert image.rgb is not None
    np.testing.assert_array_equal(thing.rgb, image.rgb[scene.pixels(thing.xyz)])


def test_density_is_points_per_square_metre() -> None:
    scene = Scene(tilt_deg=60).plane().box((-0.15, -0.15, 0), (0.15, 0.15, 0.01))
    scene = scene.box((-0.1, -0.1, 0.01), (0.1, 0.1, 0.05))
    thing = Segmenter().segment(scene.detections(scene.box_of(3)), scene.image(0.0)).objects[0]
    shown = scene.owner == 3
    front = shown & (np.abs((scene.eye + scene.rays * scene.depth[..., None])[..., 2] - 0.05) > 1e-6)
    area = 0.04 + 0.008 * min(1.0, front.sum() / 1)  # the top and the front side, both fully seen
    assert thing.density == pytest.approx(shown.sum() / area, rel=0.1)


def test_the_support_surface_is_instance_0_and_lies_on_the_table() -> None:
    scene = two_boxes()
    support = Segmenter().segment(scene.detections(), scene.image(NOISE)).support
    assert support is not None
    assert (support.instance, support.label) == (0, "support")
    heights = (support.xyz @ scene.R.T + scene.eye)[:, 2]
    assert np.median(np.abs(heights)) < 0.01


def test_the_view_is_a_quarter_of_the_image() -> None:
    frame = Segmenter().segment(two_boxes().detections(), two_boxes().image())
    assert frame.view.xyz.shape == (120, 160, 3)
    assert (frame.stamp_ns, frame.frame_id) == (7, "eye")


def test_nothing_measured_gives_a_frame_without_objects_and_without_gravity() -> None:
    scene = two_boxes()
    empty = DepthImage(depth=np.zeros((480, 640), np.float32), rgb=None, intrinsics=scene.camera, stamp_ns=0)
    frame = Segmenter().segment(scene.detections((10, 10, 300, 300)), empty)
    assert frame.objects == ()
    assert frame.support is None
    assert frame.gravity is None
    assert frame.gravity_confidence == 0
    assert np.isnan(frame.view.xyz).all()


def test_preset_paper_loses_the_largest_plane_of_the_crop() -> None:
    scene = Scene().plane().box((-0.1, 0.0, 0), (0.1, 0.04, 0.3))
    image = scene.image(NOISE)
    boxes = scene.detections(scene.box_of(2, pad=0.02))
    ours = Segmenter().segment(boxes, image).objects[0]
    founding = Segmenter(SegmenterParams(preset="paper")).segment(boxes, image).objects
    assert scene.iou(ours.xyz, 2) > 0.9
    assert not founding or scene.iou(founding[0].xyz, 2) < 0.5


def test_warming_up_changes_nothing() -> None:
    segmenter = Segmenter()
    scene = two_boxes()
    frame = segmenter.segment(scene.detections(scene.box_of(2)), scene.image(NOISE))
    assert [item.label for item in frame.objects] == ["0", UNNAMED]


def test_a_mask_takes_the_place_of_what_stands_in_its_box_and_none_leaves_a_box_as_it_is() -> None:
    scene = two_boxes()
    asked, image = scene.detections(scene.box_of(2), scene.box_of(3)), scene.image(NOISE)
    half = scene.owner == 2
    half[:, : int(np.flatnonzero(half.any(axis=0)).mean())] = False
    frame = Segmenter().segment(asked, image, masks=[half, None])
    assert len(frame.objects) == 2
    assert 0.4 * (scene.owner == 2).sum() < len(frame.objects[0]) < 0.6 * (scene.owner == 2).sum()
    np.testing.assert_array_equal(frame.objects[1].xyz, Segmenter().segment(asked, image).objects[1].xyz)


@pytest.mark.parametrize("every", [1, 2])
def test_instances_of_any_size_take_the_place_of_what_stands_in_the_boxes(every: int) -> None:
    scene = two_boxes()
    asked, image = scene.detections(scene.box_of(2), scene.box_of(3)), scene.image(NOISE)
    halves = [scene.owner == 2, scene.owner == 3]
    for half in halves:
        half[:, : int(np.flatnonzero(half.any(axis=0)).mean())] = False
    numbers = (halves[0] + 2 * halves[1].astype(np.uint16)).astype(np.uint16)
    frame = Segmenter().segment(replace(asked, instances=np.ascontiguousarray(numbers[::every, ::every])), image)
    masked = Segmenter().segment(asked, image, masks=halves)
    assert len(frame.objects) == 2
    for one, other, half in zip(frame.objects, masked.objects, halves, strict=True):
        assert abs(len(one) - half.sum()) < 0.06 * half.sum()
        if every == 1:
            np.testing.assert_array_equal(one.xyz, other.xyz)


def test_a_box_that_no_instance_is_of_gives_no_object() -> None:
    scene = two_boxes()
    numbers = 2 * (scene.owner == 3).astype(np.uint16)
    asked = replace(scene.detections(scene.box_of(2), scene.box_of(3)), instances=numbers)
    assert [
        one.label for one in Segmenter(SegmenterParams(unnamed=False)).segment(asked, scene.image(NOISE)).objects
    ] == ["1"]


@pytest.mark.parametrize(
    ("masks", "message"),
    [
        ([], "masks: expected one or None for each of 1 boxes, got 0"),
        ([np.ones((480, 640), np.uint8)], r"mask: expected bool of shape \(480, 640\), got uint8"),
        ([np.ones((240, 320), bool)], r"mask: expected bool of shape \(480, 640\), got bool of \(240, 320\)"),
    ],
)
def test_masks_of_another_number_type_or_shape_are_refused(masks: list[np.ndarray], message: str) -> None:
    scene = two_boxes()
    with pytest.raises(ValueError, match=message):
        Segmenter().segment(scene.detections(scene.box_of(2)), scene.image(), masks=masks)
