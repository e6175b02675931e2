# SPDX-License-Identifier: Apache-2.0
"""The prior boxes."""

from __future__ import annotations

import numpy as np
import pytest

from training.priors import INPUT_HW, SIDES_PX, STRIDES, grid_hw, make_priors


def test_there_is_one_prior_for_every_cell_of_every_level() -> None:
    assert make_priors().shape == (sum(int(np.prod(grid_hw(stride))) for stride in STRIDES), 4)


def test_the_first_prior_is_the_small_square_in_the_first_cell() -> None:
    height, width = INPUT_HW
    first = make_priors()[0] * [width, height, width, height]
    assert first == pytest.approx([4, 4, SIDES_PX[0], SIDES_PX[0]], abs=1e-3)


def test_rows_of_a_level_run_along_the_image_first() -> None:
    priors = make_priors()
    _, columns = grid_hw(STRIDES[0])
    along, down = priors[1], priors[columns]
    assert along[0] > priors[0, 0] and along[1] == priors[0, 1]
    assert down[1] > priors[0, 1] and down[0] == priors[0, 0]
