# SPDX-License-Identifier: Apache-2.0
"""The masks of a ``detections_table``: one more column, in which each box has a PNG of the pixels that it touches."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from objreg_ros import limits
from objreg_ros.bridge.messages.layout import MASK
from objreg_ros.bridge.messages.pictures import require_picture
from objreg_ros.data.images import Detections

Array = NDArray[Any]

BILEVEL = (cv2.IMWRITE_PNG_BILEVEL, 1)


def with_masks(records: Array, found: Detections) -> Array:
    """The records ``(1, N)`` of what was found, with the column of masks where there are; ValueError for too much."""
    numbers = found.instances_at(found.image_hw)
    if numbers is None or not len(found):
        return records
    pngs = [_png(numbers[found.touched(k)] == k + 1) for k in range(len(found))]
    longest, most = max(map(len, pngs)), limits.MOST_RECORD - records.itemsize
    if longest > most:
        raise ValueError(f"detections: expected masks of at most {most} bytes as PNG, got {longest}")
    masked = np.zeros(records.shape, [*records.dtype.descr, (MASK, "u1", (max(longest, 2),))])
    for name in records.dtype.names or ():
        masked[name] = records[name]
    for k, png in enumerate(pngs):
        masked[MASK][0, k, : len(png)] = png
    return masked


def read_masks(records: Array, found: Detections) -> Array | None:
    """The ``instances`` of the records ``(N,)`` of what was found; None for a table without masks.

    ValueError for what is no PNG of the size of its box, and for a picture beyond `limits.MOST_PIXELS_OF_PICTURE`.
    """
    if MASK not in (records.dtype.names or ()) or not len(found):
        return None
    column, (height, width) = records[MASK], found.image_hw
    if column.dtype != np.uint8 or column.ndim != 2:
        raise ValueError(f"masks: expected several uint8 for each box, got {column.dtype} of shape {column.shape}")
    if height * width > limits.MOST_PIXELS_OF_PICTURE:
        most = limits.MOST_PIXELS_OF_PICTURE
        raise ValueError(f"masks: expected a picture of at most {most} pixels, got {width} x {height}")
    numbers = np.zeros(found.image_hw, np.uint16)
    for k in range(len(found)):
        inside = numbers[found.touched(k)]
        if inside.size:
            inside[_mask(column[k], inside.shape)] = k + 1
    return numbers


def _png(mask: Array) -> Array:
    """A mask ``(h, w) bool`` as the bytes of a PNG of one bit a pixel; none of a mask without pixels."""
    if not mask.size:
        return np.zeros(0, np.uint8)
    return cv2.imencode(".png", mask.view(np.uint8), BILEVEL)[1].ravel()


def _mask(png: Array, hw: tuple[int, int]) -> Array:
    data = png.tobytes()
    require_picture(data, ("PNG",), hw[0] * hw[1])
    mask = cv2.imdecode(png, cv2.IMREAD_GRAYSCALE)
    if mask is None or mask.shape != hw:
        got = f"{len(data)} bytes that do not decode" if mask is None else list(mask.shape)
        raise ValueError(f"masks: expected a PNG of the size of its box, {list(hw)}, got {got}")
    return np.asarray(mask > 0)
