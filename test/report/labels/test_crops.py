# SPDX-License-Identifier: Apache-2.0
"""Crops of an object, spread over a run."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.report.labels.crops import BORDER, MOST, TILE, Crops, crop
from objreg_tools.report.labels.visible_part import VisiblePart, visible_part
from report.labels.scene import seen, square


@pytest.fixture(scope="module")
def part() -> VisiblePart:
    found = visible_part(square(), seen(), np.eye(4))
    assert found is not None
    return found


def test_a_crop_has_the_object_in_its_middle_within_its_border(part: VisiblePart) -> None:
    picture = crop(np.asarray(seen().rgb), part)
    assert picture.shape == (TILE, TILE, 3) and picture[TILE // 2, TILE // 2].tolist() == [200, 40, 40]
    assert (picture == BORDER).all(axis=2).any() and picture[2, 2].tolist() == [90, 90, 90]


def test_few_crops_are_kept_spread_over_all_that_came(part: VisiblePart) -> None:
    crops = Crops()
    for k in range(200):
        crops.add(k, np.asarray(seen().rgb), part)
    stamps = [one.stamp_ns for one in crops.chosen]
    assert crops.count == 200 and len(stamps) == MOST and stamps[0] == 0 and stamps[-1] > 150
    assert max(np.diff(stamps)) <= 2 * min(np.diff(stamps)) and crops.chosen[0].picture.startswith("data:image/webp")


def test_of_few_that_came_all_are_shown(part: VisiblePart) -> None:
    crops = Crops()
    assert crops.chosen == []
    crops.add(5, np.asarray(seen().rgb), part)
    assert [one.stamp_ns for one in crops.chosen] == [5]
