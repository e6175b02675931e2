# SPDX-License-Identifier: Apache-2.0
"""The masks of a segmentation head: each is a sum of prototypes (Bolya et al., "YOLACT", 2019)."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Detections
from objreg_ros.detector.contract import Candidates
from objreg_ros.detector.picture import Placement


def draw_masks(found: Detections, candidates: Candidates, rows: Array, place: Placement) -> Array | None:
    """The ``instances`` of what was found in these rows of the candidates; None where the model gives no masks.

    A mask is where the sum is above 0, a sigmoid of more than a half, cut to its box. Of two that overlap the better
    scored one has the pixel.
    """
    if candidates.coefficients is None or candidates.prototypes is None:
        return None
    numbers = np.zeros(found.image_hw, np.uint16)
    for k in reversed(range(len(rows))):
        box = found.touched(k)
        logits = np.tensordot(candidates.coefficients[rows[k]], candidates.prototypes, 1)
        numbers[box][_seen(logits, box, place) > 0] = k + 1
    return numbers


def _seen(logits: Array, box: tuple[slice, slice], place: Placement) -> Array:
    """Values ``(h, w)`` over the model's picture as the pixels of a box of the camera's see them, linear between."""
    scale, first = np.ones(2), np.zeros(2)  # of y and x: the value that is at a pixel is at scale * pixel + first
    for axis, (size, inner, before) in enumerate(((0, place.height, place.top), (1, place.width, place.left))):
        share = logits.shape[axis] / place.model_hw[axis]
        scale[axis] = inner / place.hw[size] * share
        first[axis] = (box[axis].start + 0.5) * scale[axis] + before * share - 0.5
    rows, columns = (side.stop - side.start for side in box)
    affine = np.array([[scale[1], 0.0, first[1]], [0.0, scale[0], first[0]]])
    how = {"flags": cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, "borderMode": cv2.BORDER_REPLICATE}
    return cv2.warpAffine(np.asarray(logits, np.float32), affine, (columns, rows), **how)
