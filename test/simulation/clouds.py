# SPDX-License-Identifier: Apache-2.0
"""Reads organised clouds of the Point Cloud Library (PCD 0.7, binary_compressed), as far as the tests need them."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def _expand(packed: bytes, size: int) -> np.ndarray:
    """LZF: a byte below 32 is followed by that many literals and one more, any other refers back."""
    out = bytearray()
    i = 0
    while i < len(packed):
        head = packed[i]
        i += 1
        if head < 32:
            out += packed[i : i + head + 1]
            i += head + 1
            continue
        length = head >> 5
        if length == 7:
            length += packed[i]
            i += 1
        start = len(out) - ((head & 31) << 8) - packed[i] - 1
        i += 1
        piece = out[start : start + length + 2]
        out += (piece * -(-(length + 2) // len(piece)))[: length + 2]  # it may overlap itself
    assert len(out) == size
    return np.frombuffer(bytes(out), np.uint8)


def read_organised_pcd(path: Path) -> np.ndarray:
    """The depth z (H, W) float32 of a cloud in metres, 0 where there is none."""
    content = path.read_bytes()
    end = content.index(b"\n", content.index(b"\nDATA ") + 1) + 1
    lines = [line.split() for line in content[:end].decode().splitlines() if not line.startswith("#")]
    header = {line[0]: line[1:] for line in lines}
    assert header["DATA"] == ["binary_compressed"]
    height, width = int(header["HEIGHT"][0]), int(header["WIDTH"][0])
    packed, size = (int(v) for v in np.frombuffer(content, "<u4", 2, end))
    plain = _expand(content[end + 8 : end + 8 + packed], size)
    sizes = [int(s) * height * width for s in header["SIZE"]]
    at = sum(sizes[: header["FIELDS"].index("z")])
    return np.nan_to_num(plain[at : at + 4 * height * width].view("<f4").reshape(height, width), nan=0.0)
