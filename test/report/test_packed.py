# SPDX-License-Identifier: Apache-2.0
"""Points come back from 16 bits a coordinate."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np

from objreg_tools.report.packed import packed, zipped


def unpacked(cloud: dict[str, Any]) -> np.ndarray:
    """As templates/space.js does."""
    steps = np.frombuffer(base64.b64decode(cloud["xyz"]), "<u2").reshape(3, -1).T
    return np.array(cloud["low"]) + cloud["step"] * steps


def unzipped(text: str) -> bytes:
    """As templates/unzip.js does."""
    return gzip.decompress(base64.b64decode(text))


def test_points_come_back_to_half_a_step() -> None:
    xyz = np.random.default_rng(0).uniform((-1, 0, 5), (1, 20, 6), (500, 3))
    cloud = packed(xyz)
    assert cloud["step"] < 20 / 65000 and np.abs(unpacked(cloud) - xyz).max() <= 0.501 * cloud["step"]
    assert len(cloud["xyz"]) == 500 * 8


def test_one_point_and_none_are_packed_too() -> None:
    assert np.array_equal(unpacked(packed(np.array([[1.0, 2.0, 3.0]]))), [[1.0, 2.0, 3.0]])
    assert unpacked(packed(np.zeros((0, 3)))).shape == (0, 3)


def test_what_is_zipped_comes_back_and_is_the_same_each_time() -> None:
    text = "a café " * 1000
    assert unzipped(zipped(text.encode())).decode() == text
    assert zipped(text.encode()) == zipped(text.encode()) and len(zipped(text.encode())) < len(text) / 20
