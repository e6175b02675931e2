# SPDX-License-Identifier: Apache-2.0
"""Detections as targets in the depth image."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.images import Detections
from objreg_ros.segmenter.objects.targets import read_targets

SHAPE = 240, 320
INSIDE = (10.0, 20.0, 110.0, 220.0)


def asked(*rows: tuple[str, tuple[float, float, float, float]], ids: tuple[str, ...] = ()) -> Detections:
    return Detections(
        xyxy=np.array([box for _, box in rows], np.float32).reshape(-1, 4),
        score=np.linspace(1.0, 0.5, len(rows), dtype=np.float32),
        label=tuple(label for label, _ in rows),
        image_hw=(480, 640),
        stamp_ns=0,
        ids=ids,
    )


def test_a_detection_is_a_target_in_pixels_of_the_depth_image() -> None:
    (target,), people = read_targets(asked(("cup", INSIDE), ids=("cup-7",)), None, SHAPE)
    assert (target.box, target.label, target.score, target.detection_id) == ((5, 10, 55, 110), "cup", 1.0, "cup-7")
    assert target.outline is None and people == []


def test_a_person_is_no_target_and_an_empty_box_is_neither() -> None:
    outside = (700.0, 20.0, 800.0, 90.0)
    rows = ("cup", outside), ("person", INSIDE), ("person", outside), ("box", INSIDE)
    targets, people = read_targets(asked(*rows), None, SHAPE)
    assert [target.label for target in targets] == ["box"] and people == [(5, 10, 55, 110)]


def test_a_mask_stays_with_its_box_when_others_are_left_out() -> None:
    mask = np.zeros(SHAPE, bool)
    mask[30:60, 20:40] = True
    (target,), _ = read_targets(asked(("person", INSIDE), ("cup", INSIDE)), [None, mask], SHAPE)
    assert target.outline is not None and target.outline.numbers is mask
