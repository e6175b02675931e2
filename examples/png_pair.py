# SPDX-License-Identifier: Apache-2.0
"""Two RGB-D pictures from PNG files: `png_pair.py rgb_1 depth_1 rgb_2 depth_2 FX FY CX CY`, the camera in pixels.

Depth is registered to colour and has 16 bits: millimetres, as most drivers write it. TUM's has 5000 to the metre.
"""

import sys

import cv2
import numpy as np

from objreg_ros import Camera, register

PER_METRE = 1000


def read(path: str, how: int) -> np.ndarray:
    """The pixels of a file; SystemExit where it is no picture."""
    pixels = cv2.imread(path, how)
    if pixels is None:
        raise SystemExit(f"{path}: expected a picture, got none")
    return pixels


def main(rgb_1: str, depth_1: str, rgb_2: str, depth_2: str, *camera: str) -> None:
    """Register the pictures and print the pose, or why there is none."""
    colours = [cv2.cvtColor(read(path, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB) for path in (rgb_1, rgb_2)]
    depths = [read(path, cv2.IMREAD_UNCHANGED).astype(np.float32) / PER_METRE for path in (depth_1, depth_2)]
    fx, fy, cx, cy = map(float, camera)
    result = register(colours[0], depths[0], colours[1], depths[1], Camera(fx, fy, cx, cy))
    if not result.accepted:
        raise SystemExit(f"refused: {result.reason}, {result.detail}")
    print(f"accepted, T_1_2:\n{result.T_1_2.round(3)}")


if __name__ == "__main__":
    if len(sys.argv) != 9:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
