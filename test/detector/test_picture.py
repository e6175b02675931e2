# SPDX-License-Identifier: Apache-2.0
"""The input tensor of a model."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.detector.picture import Look, Picture, Placement, read_imgsz
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
        (),
    ],
)
def test_an_input_that_is_no_picture_is_refused_with_expected_and_got(inputs: tuple[Port, ...]) -> None:
    with pytest.raises(ValueError, match=r"expected one input, uint8 \[1, H, W, 3\].*got"):
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


@pytest.mark.parametrize("size", [(480, 640), (640, 480), (97, 331), (1080, 1920), (1, 900)])
@pytest.mark.parametrize("model", [(640, 640), (64, 96), (320, 256)])
@pytest.mark.parametrize("fit", ["stretched", "centre", "corner"])
def test_what_is_seen_in_the_models_picture_comes_back_where_it_was(
    size: tuple[int, int], model: tuple[int, int], fit: str
) -> None:
    rgb = np.zeros((*size, 3), np.uint8)
    height, width = size
    true = np.array([width // 4, height // 3, width * 3 // 4, max(height * 5 // 6, 1)])
    rgb[true[1] : true[3], true[0] : true[2]] = 255
    picture = Picture.of((Port("x", "uint8", (1, *model, 3)),), {}).asked(Look(fit=fit), {})
    row, column = np.nonzero(picture.tensor(rgb)[0, ..., 0] > 127)
    seen = np.array([[column.min(), row.min(), column.max() + 1, row.max() + 1]]) / [*model[::-1], *model[::-1]]
    pixel = max(1, *(np.array(size) / model if fit == "stretched" else [max(np.array(size) / model)]))
    assert picture.place(rgb).to_image(seen)[0] == pytest.approx(true, abs=0.51 * pixel + 1e-3)


def test_a_picture_in_the_centre_is_between_grey_and_one_at_the_corner_before_it() -> None:
    assert Placement.of((480, 640), (640, 640), "centre") == Placement((480, 640), (640, 640), 80, 0, 480, 640)
    assert Placement.of((480, 640), (640, 640), "corner") == Placement((480, 640), (640, 640), 0, 0, 480, 640)
    assert Placement.of((480, 639), (416, 416), "centre").top == 52  # of 104 - 1 rows, the smaller half is above
    picture = Picture.of((Port("x", "float", (1, 3, 64, 64)),), {})
    look = Look(fit="centre", bgr=True, mean=0.0, scale=1 / 255)
    tensor = picture.asked(look, {}).tensor(np.full((32, 64, 3), (255, 0, 51), np.uint8))[0]
    assert tensor[:, 0, 0] == pytest.approx([114 / 255] * 3) and tensor[:, 63, 63] == pytest.approx([114 / 255] * 3)
    assert tensor[:, 16, 0] == pytest.approx([0.2, 0, 1]) and tensor[:, 47, 63] == pytest.approx([0.2, 0, 1])


def test_half_floats_are_given_to_a_model_that_asks_for_them() -> None:
    picture = Picture.of((Port("x", "float16", (1, 3, 30, 40)),), {})
    assert picture.tensor(np.zeros((30, 40, 3), np.uint8)).dtype == np.float16


def test_the_second_input_states_width_and_height_of_the_models_picture() -> None:
    picture = Picture.of((Port("x", "float", (1, 3, 30, 40)), Port("orig_target_sizes", "int64", (1, 2))), {})
    tensor = picture.tensor(np.zeros((50, 70, 3), np.uint8))
    assert {name: value.tolist() for name, value in picture.extra(tensor).items()} == {"orig_target_sizes": [[40, 30]]}


def test_an_open_size_is_that_of_the_metadata_or_the_usual_one() -> None:
    picture = Picture.of((Port("x", "float", (1, 3, None, None)),), {})
    assert picture.usual_hw({}) == (640, 640)
    assert picture.usual_hw({"imgsz": "[320, 416]"}) == (320, 416)
    assert Picture.of((Port("x", "uint8", (1, None, None, 3)),), {}).usual_hw({}) == (480, 640)


@pytest.mark.parametrize("text", ["", "x", "[1, 2, 3]", "[0, 640]", "[-1, 5]", "[" * 5000, "[99999, 99999]", "NaN"])
def test_a_size_in_the_metadata_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"expected .*got") as refusal:
        read_imgsz({"imgsz": text})
    assert len(str(refusal.value)) < 300
