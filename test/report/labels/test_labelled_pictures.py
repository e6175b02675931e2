# SPDX-License-Identifier: Apache-2.0
"""Pictures with what they show of several objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.images import DepthImage
from objreg_tools.report.labels.labelled_pictures import apart, labelled_pictures
from objreg_tools.report.labels.visible_part import VisiblePart, visible_part
from report.labels.scene import BOX, SECOND, FewPictures, seen, square

POSES = [(k * SECOND, np.eye(4)) for k in range(3)]


def part(image: DepthImage | None = None, **named: object) -> VisiblePart:
    found = visible_part(square(**named), image or seen(), np.eye(4))  # type: ignore[arg-type]
    assert found is not None
    return found


def test_every_picture_that_shows_an_object_has_it() -> None:
    album = FewPictures({0: seen(), SECOND: seen(shown=False, stamp_ns=SECOND)})
    found = list(labelled_pictures([square()], POSES, album))  # type: ignore[arg-type]
    assert [(one.stamp_ns, len(one.parts)) for one in found] == [(0, 1), (SECOND, 0)]
    assert found[0].parts[0].xyxy == pytest.approx(BOX, abs=1)


def test_what_is_seen_too_little_of_is_not_labelled() -> None:
    image = seen()
    depth = image.depth.copy()
    depth[:, :175] = 0.6  # a quarter is left
    album = FewPictures({0: replace(image, depth=depth)})
    counts = [
        len(next(labelled_pictures([square()], POSES, album, least)).parts)  # type: ignore[arg-type]
        for least in (0.2, 0.3)
    ]
    assert counts == [1, 0]


def test_of_two_that_cover_each_other_the_one_with_a_name_is_left() -> None:
    (left,) = apart([part(landmark=1, label="thing", seconds=(0.0, 1.0, 2.0)), part(landmark=2)])
    assert left.object.label == "cup"


def test_a_pixel_of_two_goes_to_the_one_whose_depth_is_nearer() -> None:
    first = part(landmark=1)
    beside = replace(first, object=square(2), corner=(first.corner[0] + 30, first.corner[1]), off=first.off + 0.01)
    a, b = apart([first, beside])
    assert a.pixels == first.pixels and a.xyxy == first.xyxy
    assert b.xyxy[0] == first.xyxy[2] and b.pixels == pytest.approx(beside.pixels / 2, rel=0.05)
