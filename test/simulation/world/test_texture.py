# SPDX-License-Identifier: Apache-2.0
"""Textures: pictures of the right kind that differ from seed to seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from objreg_tools.simulation.world import texture
from simulation.pictures import require_square_and_seeded

PICTURES: list[Callable[[np.random.Generator], np.ndarray]] = [
    texture.wood, texture.tiles, texture.fabric, texture.marble, texture.brushed, texture.patches, texture.stripes,
    texture.any_surface,
]  # fmt: skip


@pytest.mark.parametrize("draw", PICTURES, ids=lambda draw: draw.__name__)
def test_a_picture_is_square_of_a_power_of_two_and_follows_from_its_seed(draw: Callable[..., np.ndarray]) -> None:
    require_square_and_seeded(draw)


@pytest.mark.parametrize(
    ("hue", "saturation", "value", "rgb"),
    [(0.0, 1.0, 1.0, (255, 0, 0)), (1 / 3, 1.0, 1.0, (0, 255, 0)), (0.5, 0.0, 0.5, (128, 128, 128)),
     (2 / 3, 1.0, 0.5, (0, 0, 128)), (1.0, 1.0, 1.0, (255, 0, 0))],
)  # fmt: skip
def test_hsv_gives_known_colours(hue: float, saturation: float, value: float, rgb: tuple[int, int, int]) -> None:
    assert texture.hsv(hue, saturation, value) == pytest.approx(rgb, abs=1)


def test_a_contrasting_colour_stands_out() -> None:
    rng = np.random.default_rng(0)
    for background in ((10, 10, 10), (250, 250, 250), (90, 20, 60)):
        ink = texture.contrasting(rng, background)
        assert max(abs(a - b) for a, b in zip(ink, background, strict=True)) > 60


def test_noise_repeats_at_the_borders() -> None:
    field = texture.noise(np.random.default_rng(1), 64, 4)
    inner = np.abs(np.diff(field, axis=0)).max()
    assert np.abs(field[0] - field[-1]).max() <= 1.5 * inner and field.std() > 0.1


def test_writing_stays_within_its_box() -> None:
    for seed in range(10):
        picture = texture.filled((0, 0, 0), 128)
        texture.write_across(picture, "Hello", (20, 40, 100, 80), (255, 255, 255), np.random.default_rng(seed))
        rows, columns = np.nonzero(picture[..., 0])
        assert len(rows) > 50
        assert columns.min() >= 8 and columns.max() <= 116 and rows.min() >= 20 and rows.max() <= 100
