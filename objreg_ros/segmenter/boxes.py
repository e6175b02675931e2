# SPDX-License-Identifier: Apache-2.0
"""Detection boxes as whole pixels of the depth image."""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array, Detections

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 pixels; x1 and y1 are outside


def pixel_boxes(detections: Detections, height: int, width: int) -> list[Box]:
    """The boxes scaled from the detector's image to a ``height`` × ``width`` one and clipped to it.

    Only pixels wholly inside a box belong to it. A box outside the image comes back empty (x1 <= x0 or y1 <= y0).
    """
    image_h, image_w = detections.image_hw
    scale = np.array([width / image_w, height / image_h] * 2)
    scaled = detections.xyxy.astype(np.float64) * scale
    low = np.ceil(np.clip(scaled[:, :2], 0, (width, height)) - 1e-6)
    high = np.floor(np.clip(scaled[:, 2:], 0, (width, height)) + 1e-6)
    return [_box(row) for row in np.hstack([low, high]).astype(int)]


def _box(row: Array) -> Box:
    return int(row[0]), int(row[1]), int(row[2]), int(row[3])


def is_empty(box: Box) -> bool:
    """Whether no pixel lies in ``box``."""
    return box[2] <= box[0] or box[3] <= box[1]
