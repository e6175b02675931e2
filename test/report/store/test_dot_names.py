# SPDX-License-Identifier: Apache-2.0
"""Names beside dots."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from objreg_tools.report.store.dot_names import GAP, LETTER, Box, Dot, placed


def test_a_lone_dot_has_its_name_to_the_right() -> None:
    (box,) = placed([Dot(50, 50, 4, "cup 1", 1)], 200, 100)
    assert box is not None and box.left == 54 + GAP and box.right == 54 + GAP + 5 * LETTER and box.top < 50 < box.bottom


def test_at_the_right_edge_a_name_goes_to_the_left() -> None:
    (box,) = placed([Dot(195, 50, 4, "cup 1", 1)], 200, 100)
    assert box is not None and box.right == 191 - GAP


def test_no_name_lies_upon_another_or_upon_a_dot_or_outside() -> None:
    rng = np.random.default_rng(5)
    dots = [Dot(*xy, 5.0, f"bottle {k}", float(k)) for k, xy in enumerate((rng.random((60, 2)) * (380, 240)).tolist())]
    boxes = [box for box in placed(dots, 380, 240) if box is not None]
    marks = [Box(x - r, y - r, x + r, y + r) for x, y, r, _, _ in dots]
    assert 10 < len(boxes) < len(dots)
    assert not any(a.meets(b) for a, b in combinations(boxes, 2))
    assert not any(box.meets(mark) for box in boxes for mark in marks)
    assert all(box.left >= 0 and box.top >= 0 and box.right <= 380 and box.bottom <= 240 for box in boxes)


def test_of_two_dots_at_one_place_the_one_that_was_seen_more_is_named_first() -> None:
    rare, often = placed([Dot(50, 50, 4, "a", 1), Dot(50, 50, 4, "b", 9)], 200, 100)
    assert often is not None and rare is not None and often.left > rare.left
