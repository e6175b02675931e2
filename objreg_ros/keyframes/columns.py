# SPDX-License-Identifier: Apache-2.0
"""Whole numbers as bytes that compress well: the lowest byte of all of them first, then the next."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array


def column(numbers: Array) -> bytes:
    """Whole numbers of less than 31 bits and their signs, in as many bytes each as the largest takes."""
    signed = np.asarray(numbers, np.int64).ravel()
    coded = ((signed << 1) ^ (signed >> 63)).astype("<u4")
    width = max(1, (int(coded.max(initial=0)).bit_length() + 7) // 8)
    return bytes([width]) + coded.view(np.uint8).reshape(-1, 4).T[:width].tobytes()


class Columns:
    """The columns of a body, one after the other."""

    def __init__(self, body: bytes) -> None:
        self._body, self._at = body, 0

    def next_column(self, count: int) -> Array:
        """The next column, (count,) int64."""
        width = self._body[self._at]
        end = self._at + 1 + width * count
        if not 1 <= width <= 4 or end > len(self._body):
            raise ValueError(f"expected {count} numbers of 1 to 4 bytes, got {width} bytes each and too few")
        coded = np.zeros((count, 4), np.uint8)
        coded[:, :width] = np.frombuffer(self._body, np.uint8, width * count, self._at + 1).reshape(width, count).T
        self._at = end
        unsigned = coded.view("<u4")[:, 0].astype(np.int64)
        return (unsigned >> 1) ^ -(unsigned & 1)

    def require_end(self) -> None:
        """ValueError if anything is left."""
        if self._at != len(self._body):
            raise ValueError(f"expected a packed keyframe that ends, got {len(self._body) - self._at} bytes more")
