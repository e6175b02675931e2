# SPDX-License-Identifier: Apache-2.0
"""What is counted of connected parts, on small grids by hand."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.segmenter.objects.extract import colours
from objreg_ros.segmenter.surface.cells import Window, reduce
from objreg_ros.segmenter.surface.parts import RIM, Parts, measure

JUMP = (0.012, 0.008)
LIMITS = (0.2, 9.0, 99.0)
FOCAL = 100.0  # px: at 1 m two cells are 1 cm apart


def measured(
    labels: np.ndarray,
    depth: np.ndarray | None = None,
    window: Window | None = None,
    rgb: np.ndarray | None = None,
    limit: int = 9,
    fy: float = FOCAL,
) -> Parts:
    """The parts of ``labels``, all 1 m away and all in the box if nothing else is said."""
    h, w = labels.shape
    camera = Intrinsics(fx=FOCAL, fy=fy, cx=w / 2, cy=h / 2, width=w, height=h)
    metres = np.ascontiguousarray(np.ones((h, w)) if depth is None else depth, np.float32)
    image = DepthImage(depth=metres, rgb=rgb, intrinsics=camera, stamp_ns=0)
    surface = reduce(image.depth, camera, 1, LIMITS, JUMP)
    numbers = np.ascontiguousarray(labels, np.int32)
    return measure(numbers, int(labels.max()), window or (0, 0, w, h), surface, colours(image), JUMP, limit)


def halves(height: int = 4, between: int = 0) -> np.ndarray:
    """Part 1 to the left of part 2, each three cells wide, with cells of no part between them."""
    return np.tile([1] * 3 + [0] * between + [2] * 3, (height, 1))


def test_the_part_with_most_cells_in_the_box_is_the_first() -> None:
    labels = np.zeros((6, 10), int)
    labels[:, :5], labels[2:4, 6:8], labels[2:5, 8:] = 1, 2, 3
    parts = measured(labels, window=(4, 1, 10, 6))
    assert parts.total.tolist() == [6, 30, 4]
    np.testing.assert_allclose(parts.pure, (1, 5 / 30, 1))
    assert parts.extent.tolist() == [[8, 2, 10, 5], [0, 0, 5, 6], [6, 2, 8, 4]]
    np.testing.assert_array_equal(parts.labels, np.array([0, 2, 3, 1])[labels])


def test_a_part_outside_the_box_is_none() -> None:
    parts = measured(halves(), window=(3, 0, 6, 4))
    assert parts.total.tolist() == [12]
    assert (parts.labels == np.tile([0, 0, 0, 1, 1, 1], (4, 1))).all()
    assert parts.touching.tolist() == [[4, 0]]  # where it was, cells are of no part


def test_no_more_than_the_largest_parts_are_kept() -> None:
    labels = np.tile([1, 2, 2, 3, 3, 3], (4, 1))
    parts = measured(labels, limit=2)
    assert parts.total.tolist() == [12, 8]
    assert (parts.labels == np.tile([0, 2, 2, 1, 1, 1], (4, 1))).all()


def test_where_nothing_is_there_are_no_parts() -> None:
    parts = measured(np.zeros((4, 6), int))
    assert parts.total.shape == parts.figure.shape == (0,)
    assert parts.alike.shape == (0, 0)
    assert parts.touching.shape == parts.gap.shape == (0, 1)
    assert not parts.labels.any()


def test_a_cell_in_the_middle_of_the_box_weighs_more_than_one_at_its_rim_and_one_outside_nothing() -> None:
    labels = np.zeros((7, 7), int)
    labels[3, 3], labels[1, 3], labels[3, 5:] = 1, 2, 3
    parts = measured(labels, window=(1, 1, 6, 6))
    rim = 1 - RIM * 4 / 5  # a cell at the rim is four fifths of the way to it
    np.testing.assert_allclose(parts.weight, (1, rim, rim))
    np.testing.assert_allclose(parts.pure, (1, 1, 0.5))
    assert parts.total.tolist() == [1, 1, 2]


def test_the_size_of_the_box_is_in_metres_at_the_depth_of_a_part() -> None:
    depth = np.where(halves() == 1, 1.0, 2.0)
    np.testing.assert_allclose(measured(halves(), depth).size, (0.06, 0.12), rtol=1e-6)
    np.testing.assert_allclose(measured(halves(12)).size, (0.12, 0.12), rtol=1e-6)  # the longer side counts
    np.testing.assert_allclose(measured(halves(9), fy=2 * FOCAL).size, (0.06, 0.06), rtol=1e-6)  # 9 rows, 0.045 m


def test_neighbours_without_a_depth_jump_touch() -> None:
    parts = measured(halves(5))
    assert parts.touching.tolist() == [[0, 0, 5], [0, 5, 0]]
    assert not parts.front.any()
    np.testing.assert_allclose(parts.gap[0, 2], 0.01**2, rtol=1e-4)


@pytest.mark.parametrize(("between", "gap"), [(1, 0.02**2), (2, 0.03**2), (3, np.inf)])
def test_parts_with_a_seam_between_them_are_as_far_apart_as_their_nearest_cells(between: int, gap: float) -> None:
    parts = measured(halves(4, between))
    np.testing.assert_allclose((parts.gap[0, 2], parts.gap[1, 1]), gap, rtol=1e-4)
    assert parts.touching.tolist() == [[4, 0, 0], [4, 0, 0]]  # the seam


@pytest.mark.parametrize("turns", range(4))
def test_a_part_before_another_hides_it_and_has_a_silhouette_of_its_own(turns: int) -> None:
    labels = np.rot90(halves(), turns)
    parts = measured(labels, np.where(labels == 1, 1.0, 1.5))
    assert parts.touching[:, 1:].sum() == 0
    pairs = 4 * 3  # of each of four lines one pair side by side and two with a cell between them
    assert parts.front.tolist() == [[0, 0, pairs], [0, 0, 0]]
    np.testing.assert_allclose(parts.figure, (1, 1 / (pairs + 1)))
    assert 0.5**2 < parts.gap[0, 2] < 0.5**2 + 0.05**2


@pytest.mark.parametrize(("metres", "hidden"), [(0.8, 12), (1.6, 0)])
def test_what_is_no_part_is_hidden_and_takes_nothing_from_a_silhouette(metres: float, hidden: int) -> None:
    labels = np.tile([1] * 4 + [0] * 4, (4, 1))
    parts = measured(labels, np.where(labels == 1, metres, 1.2))
    assert parts.front.tolist() == [[hidden, 0]]
    assert parts.figure.tolist() == [1]


@pytest.mark.parametrize("turns", range(4))
def test_cells_without_depth_are_nobody_s_neighbours(turns: int) -> None:
    depth = np.ones((4, 6))
    depth[:, 2] = 0
    parts = measured(np.rot90(halves(), turns), np.rot90(depth, turns))
    assert not parts.touching.any()
    assert not parts.front.any()
    np.testing.assert_allclose(parts.gap[0, 2], 0.02**2, rtol=1e-4)


@pytest.mark.parametrize(
    ("left", "right", "alike"),
    [
        ((200, 40, 40), (100, 20, 20), True),  # the same in the shade
        ((200, 40, 40), (40, 40, 200), False),
        ((1, 0, 0), (0, 0, 1), True),  # what is nearly black has no colour
        ((120, 120, 120), (250, 250, 250), True),
    ],
)
def test_parts_of_one_colour_are_alike_in_any_light(left: tuple, right: tuple, alike: bool) -> None:
    labels = halves()
    rgb = np.where((labels == 1)[..., None], left, right).astype(np.uint8)
    assert measured(labels, rgb=rgb).alike.tolist() == [[True, alike], [alike, True]]


def test_without_colour_nothing_is_alike() -> None:
    assert not measured(halves()).alike.any()


def test_the_colour_of_a_cell_is_taken_where_it_lies_in_the_whole_picture() -> None:
    rgb = np.zeros((20, 30, 3), np.uint8)
    rgb[8:16:2, 10:16:2] = (200, 40, 40)  # only the first pixel of each cell is looked at
    rgb[8:16:2, 16:22:2] = (40, 40, 200)
    camera = Intrinsics(fx=FOCAL, fy=FOCAL, cx=15, cy=10, width=30, height=20)
    image = DepthImage(depth=np.ones((20, 30), np.float32), rgb=rgb, intrinsics=camera, stamp_ns=0)
    surface = reduce(image.depth, camera, 2, LIMITS, JUMP).crop((5, 4, 11, 8))
    for labels, alike in ((halves(), False), (np.tile([[1], [2]], (2, 6)), True)):
        parts = measure(labels.astype(np.int32), 2, (0, 0, 6, 4), surface, image.rgb, JUMP, 9)
        assert parts.alike[0, 1] == alike
