# SPDX-License-Identifier: Apache-2.0
"""The detections of a frame as targets: what is to be cut out of the depth image, and where."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Detections
from objreg_ros.segmenter.objects.boxes import Box, is_empty, pixel_boxes

PERSON = "person"  # the label of what comes and goes, and is no part of a place


class Outline(NamedTuple):
    """The pixels of the picture where ``numbers (H, W)`` are ``own``: a mask, of bool or of instances."""

    numbers: Array
    own: int = 1


class Target(NamedTuple):
    """One detection: ``box`` in pixels of the depth image, the ``outline`` of its mask or None."""

    box: Box
    outline: Outline | None
    label: str
    score: float
    detection_id: str

    @property
    def is_person(self) -> bool:
        return self.label == PERSON


def read_targets(
    detections: Detections, masks: Sequence[Array | None] | None, shape: tuple[int, int]
) -> tuple[list[Target], list[Box]]:
    """The targets in a depth image of ``shape``, in the order of their boxes, and the boxes of persons.

    Empty boxes are left out. ValueError for masks of another number, type or shape.
    """
    outlines = _outlines(masks, detections, shape)
    ids = detections.ids or ("",) * len(detections)
    rows = zip(pixel_boxes(detections, *shape), outlines, detections.label, detections.score, ids, strict=True)
    targets = [Target(box, outline, label, float(score), name) for box, outline, label, score, name in rows]
    targets = [target for target in targets if not is_empty(target.box)]
    people = [target.box for target in targets if target.is_person]
    return [target for target in targets if not target.is_person], people


def _outlines(
    masks: Sequence[Array | None] | None, detections: Detections, shape: tuple[int, int]
) -> Sequence[Outline | None]:
    """The outline of each box, or None; ValueError for masks of another number or another shape."""
    count = len(detections)
    if masks is None:
        numbers = detections.instances_at(shape)
        return [None if numbers is None else Outline(numbers, k + 1) for k in range(count)]
    if len(masks) != count:
        raise ValueError(f"masks: expected one or None for each of {count} boxes, got {len(masks)}")
    for mask in masks:
        if mask is not None and (mask.dtype != np.bool_ or mask.shape != shape):
            raise ValueError(f"mask: expected bool of shape {shape}, got {mask.dtype} of {mask.shape}")
    return [None if mask is None else Outline(mask) for mask in masks]
