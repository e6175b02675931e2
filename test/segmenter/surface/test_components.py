# SPDX-License-Identifier: Apache-2.0
"""Connected parts."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.segmenter.surface.components import connect, split

JUMP = (0.012, 0.008)


def test_parts_end_at_a_depth_jump() -> None:
    depth = np.ones((6, 8), np.float32)
    depth[:, 4:] = 1.1
    labels, count = connect(depth, np.ones(depth.shape, bool), JUMP)
    assert count == 2
    assert set(np.unique(labels[:, :4])) == {1}
    assert set(np.unique(labels[:, 4:])) == {2}


@pytest.mark.parametrize("upright", [False, True])
def test_a_missing_cell_is_bridged_and_a_seam_is_not(upright: bool) -> None:
    depth, keep = np.ones((3, 9), np.float32), np.ones((3, 9), bool)

    def count() -> int:
        turned = (np.ascontiguousarray(part.T if upright else part) for part in (depth, keep))
        return connect(*turned, JUMP)[1]

    depth[:, 4], keep[:, 4] = 0, False
    assert count() == 1
    depth[:, 4] = 1
    assert count() == 2


@pytest.mark.parametrize("notched", [0, 1])
def test_what_is_parted_by_a_notch_from_above_or_below_is_one(notched: int) -> None:
    keep = np.ones((2, 5), bool)
    keep[notched, 2] = False
    labels, count = connect(np.ones((2, 5), np.float32), keep, JUMP)
    assert count == 1 and np.array_equal(labels, keep)


def test_parts_that_grow_towards_each_other_meet_half_way() -> None:
    depth, level = np.ones((3, 10), np.float32), np.zeros((3, 10), bool)
    seams = np.zeros((3, 10), bool)
    seams[:, 2:8] = True
    labels, count = split(depth, level, seams, JUMP, 1, 9)
    assert count == 2 and labels[1].tolist() == [1] * 5 + [2] * 5
