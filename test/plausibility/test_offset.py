# SPDX-License-Identifier: Apache-2.0
"""What a number that is off comes to."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.plausibility.camera_fit import CameraFit
from objreg_ros.plausibility.offset import CLOSE, SHARE, VAGUE_SIGMAS, Offset, offsets


def test_a_number_is_wrong_beyond_what_a_right_one_has_and_beyond_its_deviations() -> None:
    assert Offset(0.1, 0.02).is_wrong(4.0)
    assert not Offset(0.1, 0.03).is_wrong(4.0) and Offset(0.1, 0.03).is_wrong(3.0)
    assert not Offset(SHARE, 0.001).is_wrong(4.0), "a small one is right however sure it is"


def test_a_vague_number_needs_more_deviations_to_be_wrong() -> None:
    vague = Offset((VAGUE_SIGMAS - 0.5) * CLOSE, CLOSE)
    assert vague.is_vague and not vague.is_wrong(2.5)
    assert Offset((VAGUE_SIGMAS + 0.5) * CLOSE, CLOSE).is_wrong(2.5)
    assert not Offset(0.0, 0.99 * CLOSE).is_vague


def test_a_number_is_close_if_its_deviation_does_not_carry_it_away() -> None:
    assert Offset(0.03, 0.03).is_close and not Offset(0.03, 0.05).is_close
    assert not Offset(0.0, CLOSE).is_close and not Offset(CLOSE, 0.0).is_close


@pytest.mark.parametrize("share", [0.8, 1.25])
def test_a_fit_is_off_by_its_logarithm_and_by_the_size_of_its_centre(share: float) -> None:
    none = np.zeros(0)
    fit = CameraFit(5, share, 0.02, np.array([-0.1, 0.03]), np.array([0.01, 0.04]), np.zeros((0, 4, 4)), none)
    focal, right, down = offsets(fit)
    assert focal == (pytest.approx(np.log(1.25)), 0.02), "too long and too short count alike"
    assert right == (0.1, 0.01) and down == (0.03, 0.04)
