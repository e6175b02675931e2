# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.plausibility.camera_fit import CameraFit
from objreg_ros.plausibility.offset import Offset, offsets


@pytest.mark.parametrize(
    ("size", "sigma", "sigmas", "wrong"),
    [
        (0.04, 0.001, 3.0, False),  # surely little
        (0.08, 0.015, 4.0, True),
        (0.08, 0.025, 4.0, False),
        (0.08, 0.025, 3.0, True),
        (0.30, 0.10, 2.5, False),  # hardly known
        (0.50, 0.10, 2.5, True),
    ],
)
def test_a_number_is_wrong_by_more_than_a_share_and_more_than_its_deviations(
    size: float, sigma: float, sigmas: float, wrong: bool
) -> None:
    assert Offset(size, sigma).is_wrong(sigmas) is wrong


def test_a_number_is_believed_where_it_is_surely_near() -> None:
    assert Offset(0.03, 0.02).is_close and not Offset(0.06, 0.02).is_close and not Offset(0.0, 0.08).is_close


def test_offsets_are_those_of_the_focal_length_and_of_both_sides_of_the_principal_point() -> None:
    fit = CameraFit(8, 0.5, 0.03, np.array([-0.1, 0.02]), np.array([0.01, 0.02]), np.zeros((0, 4, 4)), np.zeros(0))
    assert offsets(fit) == (Offset(float(np.log(2.0)), 0.03), Offset(0.1, 0.01), Offset(0.02, 0.02))
