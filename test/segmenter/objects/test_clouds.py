# SPDX-License-Identifier: Apache-2.0
"""The clouds of a frame."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros import limits
from objreg_ros.data.frames import UNNAMED, PointFlag
from objreg_ros.segmenter.objects.clouds import object_clouds, support_cloud
from objreg_ros.segmenter.objects.extract import Pixels
from objreg_ros.segmenter.objects.isolate import Isolated
from objreg_ros.segmenter.objects.targets import Target
from objreg_ros.segmenter.objects.unnamed import UnnamedPixels
from segmenter.scenes import two_boxes


def pixels(count: int) -> Pixels:
    xyz = np.zeros((count, 3), np.float32)
    return Pixels(xyz, xyz, None, np.zeros(count, np.uint16), 0.5, (0, 0, 1, 1))


def found(count: int) -> Isolated:
    return Isolated(pixels(count), PointFlag.UNSUPPORTED, None)


def target(label: str) -> Target:
    return Target((0, 0, 9, 9), None, label, 0.75, f"{label}-1")


def test_objects_of_few_points_are_left_out_and_instances_count_the_others() -> None:
    unnamed = [UnnamedPixels(pixels(30), PointFlag(0), 0.875)]
    clouds = object_clouds([target("a"), target("b"), target("c")], [found(50), found(3), found(40)], unnamed, 10)
    assert [(one.label, one.instance, one.score, one.detection_id) for one in clouds] == [
        ("a", 1, 0.75, "a-1"), ("c", 2, 0.75, "c-1"), (UNNAMED, 3, 0.875, "")
    ]  # fmt: skip
    assert clouds[0].density == pytest.approx(100.0) and (clouds[0].flags == PointFlag.UNSUPPORTED).all()


def test_a_frame_has_no_more_objects_than_a_message_carries() -> None:
    most = limits.MOST_OBJECTS
    unnamed = [UnnamedPixels(pixels(30), PointFlag(0), 1.0)] * 3
    clouds = object_clouds([target("a")] * (most - 1), [found(20)] * (most - 1), unnamed, 10)
    assert len(clouds) == most and clouds[-1].label == UNNAMED


def test_a_support_has_no_points_where_an_object_stands() -> None:
    scene = two_boxes()
    image = scene.image()
    ground = scene.ground(image)
    taken = np.zeros(ground.surface.depth.shape, bool)
    whole = support_cloud(image, ground, taken)
    taken[:, : taken.shape[1] // 2] = True
    half = support_cloud(image, ground, taken)
    assert whole is not None and half is not None
    assert len(half) < 0.8 * len(whole) and half.xyz[:, 0].min() > -0.01
