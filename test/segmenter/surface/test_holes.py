# SPDX-License-Identifier: Apache-2.0
"""Holes in an object."""

from __future__ import annotations

import numpy as np

from objreg_ros.segmenter.surface.holes import _KERNELS, fill_holes

JUMP = (0.012, 0.008)


def ring() -> np.ndarray:
    chosen = np.zeros((12, 12), bool)
    chosen[2:10, 2:10] = True
    chosen[5:7, 5:7] = False
    return chosen


def test_a_hole_that_goes_on_smoothly_is_filled() -> None:
    chosen = ring()
    fill_holes(chosen, np.ones((12, 12), np.float32), JUMP)
    assert chosen[2:10, 2:10].all()
    assert chosen.sum() == 64


def test_a_hole_is_closed_where_depth_is_missing_in_the_rim() -> None:
    chosen, depth = ring(), np.ones((12, 12), np.float32)
    chosen[2:5, 5], depth[2:5, 5], depth[1, 5] = False, 0, 0
    fill_holes(chosen, depth, JUMP)
    assert chosen[5:7, 5:7].all()
    assert not chosen[2:5, 5].any()


def test_what_is_seen_through_a_hole_stays_outside() -> None:
    chosen, depth = ring(), np.ones((12, 12), np.float32)
    depth[5:7, 5:7] = 1.5
    fill_holes(chosen, depth, JUMP)
    assert not chosen[5:7, 5:7].any()


def test_a_hole_of_one_cell_in_the_smallest_ring_is_filled() -> None:
    chosen = np.ones((3, 3), bool)
    chosen[1, 1] = False
    fill_holes(chosen, np.ones((3, 3), np.float32), JUMP)
    assert chosen.all()


def test_the_bounds_are_those_of_all_rows_from_the_first_to_the_last() -> None:
    chosen = np.zeros((6, 9), bool)
    for row, column in ((0, 3), (2, 1), (2, 6), (3, 2)):
        chosen[row, column] = True
    assert _KERNELS.bounds(chosen) == (1, 0, 7, 4)
    assert _KERNELS.bounds(np.zeros((6, 9), bool)) == (0, 0, 0, 0)
