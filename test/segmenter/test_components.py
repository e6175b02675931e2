# SPDX-License-Identifier: Apache-2.0
"""Connected parts."""

from __future__ import annotations

import numpy as np

from objreg_ros.segmenter.components import connect, split

JUMP = (0.012, 0.008)


def test_parts_end_at_a_depth_jump() -> None:
    depth = np.ones((6, 8), np.float32)
    depth[:, 4:] = 1.1
    labels, count = connect(depth, np.ones(depth.shape, bool), JUMP)
    assert count == 2
    assert set(np.unique(labels[:, :4])) == {1}
    assert set(np.unique(labels[:, 4:])) == {2}


def test_a_missing_cell_is_bridged_and_a_seam_is_not() -> None:
    depth, keep = np.ones((3, 9), np.float32), np.ones((3, 9), bool)
    depth[:, 4], keep[:, 4] = 0, False
    assert connect(depth, keep, JUMP)[1] == 1
    depth[:, 4] = 1
    assert connect(depth, keep, JUMP)[1] == 2


def test_parts_that_grow_towards_each_other_meet_half_way() -> None:
    depth, level = np.ones((3, 10), np.float32), np.zeros((3, 10), bool)
    seams = np.zeros((3, 10), bool)
    seams[:, 2:8] = True
    labels, count = split(depth, level, seams, JUMP, 1, 9)
    assert count == 2 and labels[1].tolist() == [1] * 5 + [2] * 5
