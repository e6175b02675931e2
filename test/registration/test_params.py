# SPDX-License-Identifier: Apache-2.0
"""What the registrar makes of its parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest

from objreg_ros.registration.params import RegistrarNodeParams, RegistrarParams


def test_a_search_may_take_as_long_as_is_set_and_without_a_limit_for_ever() -> None:
    assert RegistrarNodeParams(search_seconds=0.4).limit == 0.4
    assert RegistrarNodeParams().limit == math.inf


def test_where_the_camera_is_mounted_is_a_pose_and_nothing_is_none() -> None:
    T = RegistrarNodeParams(T_base_camera=(0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0)).mounting
    assert T is not None
    assert np.allclose(T, [[-1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
    assert RegistrarNodeParams().mounting is None


def test_a_mounting_that_cannot_be_is_refused_when_it_is_set() -> None:
    with pytest.raises(ValueError, match="expected x y z qx qy qz qw or nothing, got"):
        RegistrarNodeParams(T_base_camera=(1.0, 2.0, 3.0))


def test_the_node_s_other_values_are_checked_too() -> None:
    with pytest.raises(ValueError, match="odom_slop: expected at least 0, got -1"):
        RegistrarNodeParams(odom_slop=-1.0)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"reaches": (0.2,)}, "reaches: expected 3 values, got 1"),
        ({"reaches": (-0.2, 0.1, 0.06)}, "reaches: expected at least 0.001, got -0.2"),
        ({"first_look": ()}, "first_look: expected 3 values, got 0"),
        ({"first_look": (150, 0, 150)}, "first_look: expected at least 1, got 0"),
        ({"pushes": ()}, "pushes: expected 1 or 2 or 3 or 4 or 5 values, got 0"),
    ],
)
def test_a_list_that_the_search_could_not_use_is_refused_when_it_is_set(values: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        RegistrarParams(**values)


@pytest.mark.parametrize("values", [{"drawn": 0}, {"shape_grey_noise": 0.0}])
def test_a_number_without_which_no_shape_is_laid_upon_another_is_refused_when_it_is_set(values: dict) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(values))}: expected at least .*, got 0"):
        RegistrarParams(**values)
