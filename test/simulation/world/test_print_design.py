# SPDX-License-Identifier: Apache-2.0
"""Prints: pictures of the right kind that differ from seed to seed, each with its parts where they belong."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from objreg_tools.simulation.world import print_design, texture
from simulation.pictures import require_square_and_seeded

PICTURES: list[Callable[[np.random.Generator], np.ndarray]] = [
    print_design.picture, print_design.cereal_box, print_design.can_label, print_design.book_cover,
    print_design.page_edges, print_design.printed_page, print_design.screen, print_design.poster,
]  # fmt: skip
SEEDS = range(12)
BASE = (40, 90, 200)


def rect(sheet: np.ndarray, part: tuple[float, float, float, float]) -> np.ndarray:
    """The pixels of a part (u0, v0, u1, v1) of a texture."""
    u0, v0, u1, v1 = (round(share * len(sheet)) for share in part)
    return sheet[v0:v1, u0:u1]


def colours(image: np.ndarray) -> int:
    """How many different colours there are."""
    return len(np.unique(image.astype(np.int32) @ [65536, 256, 1]))


@pytest.mark.parametrize("draw", PICTURES, ids=lambda draw: draw.__name__)
def test_a_picture_is_square_of_a_power_of_two_and_follows_from_its_seed(draw: Callable[..., np.ndarray]) -> None:
    require_square_and_seeded(draw)


def test_a_gradient_goes_evenly_from_one_colour_to_the_other() -> None:
    for seed in SEEDS:
        image = print_design.gradient(np.random.default_rng(seed), (0, 100, 0), (200, 0, 0), 64).astype(int)
        np.testing.assert_allclose(image[31:33, 31:33].mean(axis=(0, 1)), (100, 50, 0), atol=1.0)
        np.testing.assert_allclose(image + image[::-1, ::-1], np.full((64, 64, 3), (200, 100, 0)), atol=2)
        assert image[..., 0].min() < 15 and image[..., 0].max() > 185 and not image[..., 2].any()
        assert max(np.abs(np.diff(image, axis=axis)).max() for axis in (0, 1)) <= 5


def test_a_barcode_is_black_and_white_bars_within_its_box() -> None:
    image = texture.filled(BASE, 64)
    print_design.barcode(image, (10, 20, 51, 40), np.random.default_rng(0))
    bars = image[20:40, 10:51]
    assert set(np.unique(bars)) == {15, 250} and (bars == bars[0, :, :1][None]).all()
    image[20:40, 10:51] = BASE
    assert (image == BASE).all()


def test_the_side_of_a_package_is_of_its_colour_with_its_barcode_at_the_foot() -> None:
    side = print_design.package_side(np.random.default_rng(0), BASE, "Kiki")
    assert (side[:, :8] == BASE).all() and set(np.unique(side[214:248, 60:196])) == {15, 250}
    assert (side[10:50] != BASE).any() and not (side[10:50] == side[10]).all()  # the name


def test_the_front_of_a_package_differs_by_its_name_and_holds_no_barcode() -> None:
    one, other = (print_design.package_front(np.random.default_rng(1), BASE, brand) for brand in ("Kiki", "Mo"))
    assert one.shape == (256, 256, 3) and not np.array_equal(one, other)
    assert set(np.unique(one[214:248, 60:196])) != {15, 250}


def test_a_cereal_box_has_its_sides_where_the_atlas_says() -> None:
    atlas = print_design.CEREAL_BOX_ATLAS
    for seed in SEEDS:
        sheet = print_design.cereal_box(np.random.default_rng(seed))
        sides = {name: rect(sheet, part) for name, part in atlas.items()}
        coded = {name for name, side in sides.items() if set(np.unique(side[214:248, 60:196])) == {15, 250}}
        assert coded == {"left", "right"}
        assert (sides["top"][:40] == sides["left"][0, 0]).all()  # plain, of the colour of the package


def test_some_cereal_boxes_have_the_same_print_on_both_sides_and_others_not() -> None:
    atlas, same = print_design.CEREAL_BOX_ATLAS, set()
    for seed in SEEDS:
        sheet = print_design.cereal_box(np.random.default_rng(seed))
        same.add(np.array_equal(rect(sheet, atlas["front"]), rect(sheet, atlas["back"])))
    assert same == {True, False}


def test_a_can_has_the_same_ground_on_both_halves() -> None:
    label = print_design.can_label(np.random.default_rng(5)).astype(int)
    assert np.abs(label[:, :128] - label[:, 128:]).mean() < 60


def test_a_can_has_print_on_both_halves() -> None:
    for seed in SEEDS:
        label = print_design.can_label(np.random.default_rng(seed))
        for half in (label[:, :128], label[:, 128:]):
            edges = np.abs(np.diff(half.astype(int), axis=1)).max(axis=2) > 40
            assert edges.mean() > 0.01


def test_the_picture_and_the_title_of_a_book_are_on_its_front_and_small_print_on_its_back() -> None:
    for seed in SEEDS:
        cover = print_design.book_cover(np.random.default_rng(seed))
        front, spine, back = (
            rect(cover, part) for part in (print_design.BOOK_FRONT, print_design.BOOK_SPINE, print_design.BOOK_BACK)
        )
        base = back[0, -1]
        assert (front != base).any(axis=2).mean() > 0.01 and (spine != base).any()
        assert (back[:39] == base).all() and (back[205:] == base).all() and (back[40:200] != base).any()


def test_page_edges_are_pale_lines_along_u() -> None:
    image = print_design.page_edges(np.random.default_rng(0))
    assert (image == image[:, :1]).all() and len(np.unique(image[:, 0], axis=0)) > 10 and image.min() > 120


def test_a_page_holds_lines_of_text_within_a_pale_margin() -> None:
    for seed in SEEDS:
        page = print_design.printed_page(np.random.default_rng(seed))
        begins = (page[:, 12] == 50).all(axis=1)  # where a line of dark dashes begins
        assert begins.sum() >= 10 and page[:8].min() > 190


def test_a_screen_shows_a_picture_or_plain_windows_and_often_a_bar_at_its_foot() -> None:
    screens = [print_design.screen(np.random.default_rng(seed)) for seed in SEEDS]
    assert {colours(image) > 1000 for image in screens} == {True, False}
    bars = [(image[-10:] == image[-1, 0]).all() and (image[-12] != image[-1, 0]).any() for image in screens]
    assert {bool(bar) for bar in bars} == {True, False}
    assert all(colours(image[:-10]) > 2 for image in screens)


def test_a_poster_has_a_frame_of_one_colour() -> None:
    for seed in SEEDS:
        image = print_design.poster(np.random.default_rng(seed))
        rim = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
        assert (rim == rim[0]).all() and (image != rim[0]).any()
