# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from objreg_tools.recording.folders.picture_files import (
    brought_to,
    first_depth_size,
    is_depth,
    is_picture,
    larger_colour,
    same_shape,
)


@pytest.mark.parametrize(("name", "said"), [("a.PNG", True), ("a.jpeg", True), (".a.png", False), ("a.txt", False)])
def test_a_picture_is_known_by_its_name(name: str, said: bool) -> None:
    assert is_picture(Path(name)) is said


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [((640, 480), (1280, 960), True), ((640, 480), (1296, 968), True), ((256, 192), (1920, 1440), True),
     ((640, 480), (1280, 720), False), ((640, 480), (480, 640), False)],
)  # fmt: skip
def test_pictures_of_one_shape_show_the_same(a: tuple[int, int], b: tuple[int, int], said: bool) -> None:
    assert same_shape(a, b) is said


def test_a_larger_picture_of_the_same_shape_is_made_small_and_no_other() -> None:
    rgb = np.zeros((8, 8, 3), np.uint8)
    rgb[:, ::2] = 200
    assert (brought_to(rgb, (4, 4)) == 100).all() and brought_to(rgb, (4, 4)).shape == (4, 4, 3)
    for size in ((8, 8), (16, 16), (4, 2)):
        assert brought_to(rgb, size) is rgb
    assert larger_colour((8, 8), (4, 4)) and not larger_colour((8, 8), (4, 2)) and not larger_colour((4, 4), (8, 8))


def test_depth_is_known_by_its_pixels(tmp_path: Path) -> None:
    for name, pixels in {"d": np.ones((3, 4), np.uint16), "c": np.ones((3, 4, 3), np.uint8)}.items():
        cv2.imwrite(str(tmp_path / f"{name}.png"), pixels)
    (tmp_path / "x.png").write_text("no picture")
    assert [is_depth(tmp_path / f"{name}.png") for name in "dcx"] == [True, False, False]
    assert first_depth_size(tmp_path, ["x.png", "d.png"]) == (4, 3) and first_depth_size(tmp_path, ["x.png"]) is None
