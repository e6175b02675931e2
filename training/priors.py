# SPDX-License-Identifier: Apache-2.0
"""The prior boxes of the network: what each output row of its heads is an offset from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

INPUT_HW = (480, 640)
"""A Kinect's whole picture. The two coarsest strides do not divide its height: there the priors are spread evenly and
lie a few pixels from the middles of their cells, which training makes good."""

STRIDES = (8, 16, 32, 64, 128)

SIDES_PX = (24.0, 48.0, 96.0, 180.0, 250.0)
"""Per level, the side of the square prior; one a cell is enough where the assignment is adaptive (Zhang et al.,
"Bridging the Gap Between Anchor-based and Anchor-free Detection", 2020, section 4.4)."""

VARIANCES = (0.1, 0.1, 0.2, 0.2)


def grid_hw(stride: int) -> tuple[int, int]:
    """Rows and columns of the feature map of a stride."""
    return (-(-INPUT_HW[0] // stride), -(-INPUT_HW[1] // stride))


def make_priors() -> NDArray[np.float32]:
    """The priors ``(A, 4)``: cx cy w h in 0..1 of the image; row-major cells, finest level first."""
    height, width = INPUT_HW
    levels = []
    for stride, side in zip(STRIDES, SIDES_PX, strict=True):
        rows, columns = grid_hw(stride)
        cy, cx = np.mgrid[0:rows, 0:columns].reshape(2, -1)
        centres = (np.stack([cx, cy], axis=1) + 0.5) / (columns, rows)
        levels.append(np.concatenate([centres, np.tile((side / width, side / height), (len(centres), 1))], axis=1))
    return np.concatenate(levels).astype(np.float32)
