# SPDX-License-Identifier: Apache-2.0
"""Detection boxes as whole pixels of the depth image."""

from __future__ import annotations

import math

from objreg_ros.data.images import Detections

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 pixels; x1 and y1 are outside


def pixel_boxes(detections: Detections, height: int, width: int) -> list[Box]:
    """The boxes scaled from the detector's image to a ``height`` × ``width`` one and clipped to it.

    Only pixels wholly inside a box belong to it. A box outside the image comes back empty (x1 <= x0 or y1 <= y0).
    """
    image_h, image_w = detections.image_hw
    x, y = width / image_w, height / image_h
    return [
        (_first(x0 * x, width), _first(y0 * y, height), _end(x1 * x, width), _end(y1 * y, height))
        for x0, y0, x1, y1 in detections.xyxy.tolist()
    ]


def _first(edge: float, size: int) -> int:
    return math.ceil(min(max(edge, 0.0), size) - 1e-6)


def _end(edge: float, size: int) -> int:
    return math.floor(min(max(edge, 0.0), size) + 1e-6)


def is_empty(box: Box) -> bool:
    """Whether no pixel lies in ``box``."""
    return box[2] <= box[0] or box[3] <= box[1]


def halves(boxes: list[Box]) -> tuple[list[int], list[int]]:
    """The numbers of the boxes that are not empty, in two groups of about as many pixels."""
    groups: tuple[list[int], list[int]] = ([], [])
    pixels = [0, 0]
    areas = [0 if is_empty(box) else (box[2] - box[0]) * (box[3] - box[1]) for box in boxes]
    for k in sorted(range(len(boxes)), key=lambda k: -areas[k]):
        if areas[k] > 0:
            group = int(pixels[1] < pixels[0])
            groups[group].append(k)
            pixels[group] += areas[k]
    return groups
