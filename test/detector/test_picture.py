# SPDX-License-Identifier: Apache-2.0
"""The input tensor of a model."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.detector.picture import Picture
from objreg_ros.detector.runtime import Port


def test_a_fixed_size_is_met_and_bytes_stay_bytes() -> None:
    picture = Picture.of((Port("x", "uint8", (1, 30, 40, 3)),), {})
    tensor = picture.tensor(np.full((60, 80, 3), (10, 20, 30), np.uint8))
    assert tensor.shape == (1, 30, 40, 3) and tensor.dtype == np.uint8
    assert tensor[0, 5, 5].tolist() == [10, 20, 30]


def test_an_open_size_takes_the_picture_as_it_is() -> None:
    picture = Picture.of((Port("x", "uint8", (1, None, None, 3)),), {})
    assert picture.tensor(np.zeros((50, 70, 3), np.uint8)).shape == (1, 50, 70, 3)


def test_a_size_that_is_asked_for_holds_where_the_graph_takes_any() -> None:
    anything, fixed = (Picture.of((Port("x", "uint8", (1, *size, 3)),), {}) for size in ((None, None), (30, 40)))
    rgb = np.zeros((50, 70, 3), np.uint8)
    assert anything.sized(480, 640).tensor(rgb).shape == (1, 480, 640, 3)
    assert fixed.sized(480, 640).tensor(rgb).shape == (1, 30, 40, 3)


def test_floats_are_normalised_in_either_layout() -> None:
    rgb = np.full((30, 40, 3), (0, 127, 255), np.uint8)
    last = Picture.of((Port("x", "float", (1, 30, 40, 3)),), {})
    assert last.tensor(rgb)[0, 3, 3] == pytest.approx([-1, -0.5 / 127.5, 1])
    metadata = {"objreg.mean": "[1, 2, 3]", "objreg.scale": "0.5"}
    first = Picture.of((Port("x", "float", (1, 3, 30, 40)),), metadata)
    assert first.tensor(rgb).shape == (1, 3, 30, 40)
    assert first.tensor(rgb)[0, :, 3, 3] == pytest.approx([-0.5, 62.5, 126])


@pytest.mark.parametrize(
    "inputs",
    [
        (Port("x", "uint8", (1, 30, 40)),),
        (Port("x", "int64", (1, 30, 40, 3)),),
        (Port("x", "uint8", (1, 30, 40, 4)),),
        (Port("x", "uint8", (8, 30, 40, 3)),),
        (Port("x", "uint8", (1, 3, 30, 40)),),
        (Port("x", "uint8", (1, 30, 40, 3)), Port("y", "float", (1,))),
    ],
)
def test_an_input_that_is_no_picture_is_refused_with_expected_and_got(inputs: tuple[Port, ...]) -> None:
    with pytest.raises(ValueError, match=r"expected one input, uint8 \[1, H, W, 3\].*got x "):
        Picture.of(inputs, {})


def test_a_mean_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match=r"objreg.mean: expected a number or a list of three"):
        Picture.of((Port("x", "float", (1, 30, 40, 3)),), {"objreg.mean": "[1, 2]"})


@pytest.mark.parametrize("size", [(100_000, 100_000), (50_000_001, None), (None, 1 << 40), (-1, 300)])
def test_a_picture_that_takes_too_much_memory_is_refused_before_it_is_taken(size: tuple[int | None, ...]) -> None:
    with pytest.raises(ValueError, match=r"expected a picture of at most 50000000 pixels, got x uint8 .* smaller"):
        Picture.of((Port("x", "uint8", (1, *size, 3)),), {})


@pytest.mark.parametrize("text", ["[" * 100_000, "NaN", "[1, 2, Infinity]", "1e300", "1" + "0" * 400])
def test_a_scale_that_no_picture_has_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"objreg.scale: expected") as refusal:
        Picture.of((Port("x", "float", (1, 30, 40, 3)),), {"objreg.scale": text})
    assert len(str(refusal.value)) < 200
