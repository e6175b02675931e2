# SPDX-License-Identifier: Apache-2.0
"""Objects that no detection names, on shapes whose every pixel has a known owner."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.frames import UNNAMED, Frame, ObjectCloud, PointFlag
from objreg_ros.segmenter.objects.unnamed import MOST
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from segmenter.scenes import SMALL, Scene, two_boxes

NOISE = 0.0015
Rectangle = tuple[float, float, float, float]


def segmented(scene: Scene, *boxes: Rectangle, label: str = "box", noise: float = NOISE, **params: object) -> Frame:
    """A frame of the scene, of which these boxes are detected."""
    asked = replace(scene.detections(*boxes), label=(label,) * len(boxes))
    return Segmenter(SegmenterParams().replaced(**params)).segment(asked, scene.image(noise))


def things(frame: Frame) -> list[ObjectCloud]:
    return [item for item in frame.objects if item.label == UNNAMED]


@pytest.mark.parametrize("noise", [0.0, NOISE, 2 * NOISE])
def test_boxes_on_a_table_become_objects_without_any_detection(noise: float) -> None:
    scene = two_boxes()
    found = things(segmented(scene, noise=noise))
    assert len(found) == 2
    for owner in (2, 3):
        item = max(found, key=lambda item: scene.iou(item.xyz, owner))
        assert scene.iou(item.xyz, owner) > 0.85
        assert not item.has(PointFlag.CUT_BY_IMAGE) and not item.has(PointFlag.UNSUPPORTED) and item.score > 0.8


def test_a_thing_is_as_large_as_it_is() -> None:
    scene = Scene().plane().box((-0.1, -0.05, 0), (0.1, 0.05, 0.15))
    (item,) = things(segmented(scene))
    sides = np.ptp(item.xyz @ scene.R.T, axis=0)
    np.testing.assert_allclose(sides, (0.2, 0.1, 0.15), atol=0.03)


def test_a_picture_of_half_the_size_shows_the_same() -> None:
    scene = Scene(SMALL).plane().box((-0.1, -0.05, 0), (0.1, 0.05, 0.15))
    (item,) = things(segmented(scene))
    assert scene.iou(item.xyz, 2) > 0.8


def test_what_has_a_name_is_not_doubled_and_the_others_come_after_it() -> None:
    scene = two_boxes()
    frame = segmented(scene, scene.box_of(2))
    assert [(item.label, item.instance) for item in frame.objects] == [("box", 1), (UNNAMED, 2)]
    assert scene.iou(frame.objects[1].xyz, 3) > 0.85


def test_what_lies_within_the_box_of_a_person_is_left_out() -> None:
    scene = Scene().plane().box((-0.05, -0.05, 0), (0.05, 0.05, 0.2))
    around = scene.box_of(2, pad=0.1)
    frame = segmented(scene, around, label="person", min_points=80)
    assert frame.objects == ()
    assert len(segmented(scene, around, label="box", min_points=80).objects) == 1


def test_a_wall_behind_a_table_and_the_front_of_the_table_are_no_things() -> None:
    table = Scene(tilt_deg=20.0).plane(x=(-0.6, 0.6), y=(-0.3, 0.5)).box((-0.6, -0.31, -0.04), (0.6, -0.3, -0.001))
    wall = table.box((-9, 1.2, -9), (9, 1.3, 9))
    assert things(segmented(wall)) == []


def test_slivers_and_what_is_thinner_than_the_noise_are_no_things() -> None:
    pen = Scene().plane().box((-0.2, 0.0, 0), (0.2, 0.012, 0.012))
    sheet = Scene().plane().box((-0.1, -0.1, 0), (0.1, 0.1, 0.004))
    assert things(segmented(pen)) == [] and things(segmented(sheet)) == []


def test_a_table_that_is_bent_by_the_camera_bears_no_things() -> None:
    scene = Scene(tilt_deg=35.0).plane()
    image = scene.image(NOISE)
    v, u = np.indices(image.depth.shape)
    bump = 0.012 * np.exp(-(((u - 320) / 90.0) ** 2) - ((v - 240) / 90.0) ** 2)
    bent = replace(image, depth=(image.depth - bump).astype(np.float32))
    assert things(Segmenter().segment(scene.detections(), bent)) == []


def test_what_the_picture_cuts_in_two_is_no_thing() -> None:
    scene = Scene().plane().box((0.5, -0.15, 0), (1.0, 0.15, 0.3))
    assert (scene.owner[:, -1] == 2).any()
    assert things(segmented(scene)) == []


def test_what_is_larger_than_things_are_is_none() -> None:
    scene = Scene(tilt_deg=25.0, distance=2.5).plane().box((-0.6, 0.3, 0), (0.6, 0.6, 0.7))
    assert things(segmented(scene)) == []


def test_of_many_things_only_the_most_certain_are_kept() -> None:
    scene = Scene().plane()
    for x in (-0.3, -0.1, 0.1, 0.3):
        for y in (-0.15, 0.1):
            scene.box((x, y, 0), (x + 0.08, y + 0.08, 0.08))
    assert len(things(segmented(scene))) == MOST


@pytest.mark.parametrize("params", [{"unnamed": False}, {"preset": "paper"}])
def test_there_are_none_where_they_are_not_asked_for(params: dict[str, object]) -> None:
    assert segmented(two_boxes(), **params).objects == ()
