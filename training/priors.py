# SPDX-License-Identifier: Apache-2.0
"""The prior boxes of the network: what each output row of its heads is an offset from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

INPUT_HW = (240, 320)
"""A Kinect's 640 x 480 halved: the resize keeps the aspect and averages whole pixels."""

STRIDES = (8, 16, 32, 64, 128)

SIDES_PX: tuple[tuple[float, ...], ...] = ((12, 20), (32, 48), (72, 104), (140, 180), (220, 270))
"""Per level, the sides of the square priors; the objects range from a can far away to a chair that fills the image."""

ASPECTS: tuple[tuple[float, ...], ...] = ((1.0, 0.5), (1.0, 2.0, 0.5))
"""Width over height, of the small and of the large priors of every level."""

PRIORS_PER_CELL = sum(len(aspects) for aspects in ASPECTS)

VARIANCES = (0.1, 0.1, 0.2, 0.2)


def grid_hw(stride: int) -> tuple[int, int]:
    """Rows and columns of the feature map of a stride."""
    return (-(-INPUT_HW[0] // stride), -(-INPUT_HW[1] // stride))


def make_priors() -> NDArray[np.float32]:
    """The priors ``(A, 4)``: cx cy w h in 0..1 of the image; row-major cells, finest level first."""
    height, width = INPUT_HW
    levels = []
    for stride, sides in zip(STRIDES, SIDES_PX, strict=True):
        rows, columns = grid_hw(stride)
        cy, cx = np.mgrid[0:rows, 0:columns].reshape(2, -1)
        centres = (np.stack([cx, cy], axis=1) + 0.5) / (columns, rows)
        sizes = [
            (side * aspect**0.5 / width, side / aspect**0.5 / height)
            for side, aspects in zip(sides, ASPECTS, strict=True)
            for aspect in aspects
        ]
        levels.append(
            np.concatenate([np.repeat(centres, len(sizes), axis=0), np.tile(sizes, (len(centres), 1))], axis=1)
        )
    return np.concatenate(levels).astype(np.float32)
