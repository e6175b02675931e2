# SPDX-License-Identifier: Apache-2.0
"""Depth that was packed by RVL: runs of zeros, and differences between the pixels that are none.

A. D. Wilson, "Fast Lossless Depth Image Compression", ISS 2017. A number is a row of nibbles, its lowest three bits
first, each with a fourth bit where more follow. Eight nibbles lie in a 32-bit word of little endian, the first in its
upper bits. The numbers are: how many zeros, how many pixels behind them, and of each of these the difference to the
pixel before, zigzag (0, -1, 1, -2 …); and so on. ROS's compressed_depth_image_transport writes width and height before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from objreg_ros.native import kernels

_KERNELS = kernels("rvl")
HEADER = 8  # bytes: width and height, each an int32
TRUNCATED, TOO_LONG = -1, -2  # what is wrong with a stream


def size(packed: NDArray[np.uint8]) -> tuple[int, int]:
    """Width and height before any pixel is unpacked, whatever they are; ValueError where there are too few bytes."""
    if packed.size < HEADER:
        raise ValueError(f"compressed depth: expected an rvl header of {HEADER} bytes, got {packed.size}; truncated?")
    width, height = packed[:HEADER].view("<i4").tolist()
    return width, height


def unpack(packed: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """The pixels (H, W) behind `size`, which the caller has looked at: memory is taken for it.

    ValueError for a stream that ends before its picture, has runs that go beyond it, or numbers beyond 32 bits.
    """
    width, height = size(packed)
    stream = packed[HEADER:]
    words = np.ascontiguousarray(stream[: stream.size // 4 * 4]).view("<u4").astype(np.uint32)
    pixels = np.zeros(width * height, np.uint16)
    outcome = _KERNELS.unpack(words, pixels)
    if outcome == TRUNCATED:
        got = f"an rvl stream of {stream.size} bytes that ends before"
        raise ValueError(f"compressed depth: expected {width} × {height} pixels, got {got}; truncated?")
    if outcome == TOO_LONG:
        raise ValueError(f"compressed depth: expected {width} × {height} pixels, got an rvl stream that goes beyond")
    return pixels.reshape(height, width)
