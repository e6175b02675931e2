# SPDX-License-Identifier: Apache-2.0
"""What the kinds of models share."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.detector.contract import Graph, best_class, class_index, corners, require_rows


def graph(**probe: np.ndarray) -> Graph:
    return Graph((), (), {}, probe, 2, "auto", (64, 64))


def test_a_head_is_the_first_output_of_three_dimensions_and_prototypes_mean_masks() -> None:
    one = graph(flat=np.zeros((1, 5)), head=np.zeros((1, 5, 6)))
    assert one.head == "head" and one.masks == 0
    assert graph(head=np.zeros((1, 38, 84)), proto=np.zeros((1, 32, 16, 16))).masks == 32
    assert graph(flat=np.zeros((1, 5))).head is None


def test_centres_and_sizes_become_corners() -> None:
    assert corners(np.array([[10.0, 20, 4, 6]])).tolist() == [[8, 17, 12, 23]]


def test_the_best_class_of_a_row_counts_if_it_reaches_the_threshold() -> None:
    rows, score, index = best_class(np.array([[0.1, 0.9, np.nan], [0.2, 0.5, 0.1]], np.float32), 0.3)
    assert (rows.tolist(), index.tolist()) == ([1], [0]) and score == pytest.approx([0.9])


def test_a_class_without_a_label_and_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected one of 2 labels, got number 2 to 2"):
        class_index(np.array([2.0]), 0, 2)
    with pytest.raises(ValueError, match=r"expected \[1, 5, 6\], got \[1, 4, 6\]"):
        require_rows(np.zeros((1, 4, 6)), (1, 5, 6))
