# SPDX-License-Identifier: Apache-2.0
"""Shards of labelled pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from training.samples import Sample, Shard, write_shard


def labelled(count: int, grey: int) -> Sample:
    boxes = np.arange(4 * count, dtype=np.float32).reshape(-1, 4)
    return Sample(np.full((24, 32, 3), grey, np.uint8), boxes, np.arange(count), np.zeros(count, bool))


def test_samples_come_back_with_their_own_boxes(tmp_path: Path) -> None:
    path = tmp_path / "one.npz"
    write_shard(path, [labelled(2, 10), labelled(0, 100), labelled(3, 200)])
    shard = Shard(path)
    assert [len(shard[index].boxes) for index in range(len(shard))] == [2, 0, 3]
    assert shard[2].boxes[2].tolist() == [8, 9, 10, 11] and shard[2].classes.tolist() == [0, 1, 2]
    assert [int(shard[index].rgb.mean()) for index in range(3)] == [10, 100, 200]


def test_no_half_written_shard_is_left_under_its_name(tmp_path: Path) -> None:
    write_shard(tmp_path / "one.npz", [labelled(1, 5)])
    assert [path.name for path in tmp_path.iterdir()] == ["one.npz"]
