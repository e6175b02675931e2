# SPDX-License-Identifier: Apache-2.0
"""Depth that was packed by RVL: runs of zeros, and differences between the pixels that are none.

A. D. Wilson, "Fast Lossless Depth Image Compression", ISS 2017. A number is a row of nibbles, its lowest three bits
first, each with a fourth bit where more follow. Eight nibbles lie in a 32-bit word of little endian, the first in its
upper bits. The numbers are: how many zeros, how many pixels behind them, and of each of these the difference to the
pixel before, zigzag (0, -1, 1, -2 …); and so on. ROS's compressed_depth_image_transport writes width and height before.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

HEADER = 8  # bytes: width and height, each an int32
MOST_NIBBLES = 11  # of a number of 32 bits
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
    outcome = int(_unpack(words, pixels))
    if outcome == TRUNCATED:
        got = f"an rvl stream of {stream.size} bytes that ends before"
        raise ValueError(f"compressed depth: expected {width} × {height} pixels, got {got}; truncated?")
    if outcome == TOO_LONG:
        raise ValueError(f"compressed depth: expected {width} × {height} pixels, got an rvl stream that goes beyond")
    return pixels.reshape(height, width)


def warm() -> None:
    """Load the kernel, or compile it, as `unpack` calls it."""
    unpack(np.array([1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0x01 << 4], np.uint8))


@numba.njit(cache=True, nogil=True)
def _unpack(words, pixels):  # type: ignore[no-untyped-def]
    """Fill the pixels; 0, `TRUNCATED` or `TOO_LONG`. Each round takes two numbers off the stream, so it ends."""
    at, done, before = 0, 0, 0
    while done < pixels.size:
        zeros, at = _number(words, at)
        if at < 0 or zeros > pixels.size - done:
            return at if at < 0 else TOO_LONG
        done += zeros
        others, at = _number(words, at)
        if at < 0 or others > pixels.size - done:
            return at if at < 0 else TOO_LONG
        for _ in range(others):
            zigzag, at = _number(words, at)
            if at < 0:
                return at
            before = (before + ((zigzag >> 1) ^ -(zigzag & 1))) & 0xFFFF
            pixels[done] = before
            done += 1
    return 0


@numba.njit(cache=True, nogil=True)
def _number(words, at):  # type: ignore[no-untyped-def]
    """The number at a nibble, and the nibble behind it; 0 and what is wrong where there is none."""
    value = np.int64(0)
    for k in range(MOST_NIBBLES):
        if at >> 3 >= words.size:
            return 0, TRUNCATED
        nibble = (words[at >> 3] >> np.uint32(28 - 4 * (at & 7))) & np.uint32(0xF)
        at += 1
        value |= np.int64(nibble & np.uint32(7)) << (3 * k)
        if nibble < 8:
            return value, at
    return 0, TOO_LONG
