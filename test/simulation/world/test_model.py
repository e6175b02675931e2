# SPDX-License-Identifier: Apache-2.0
"""Instances: symmetry and rest."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.model import ObjectModel, Symmetry, half_turns, revolution, turn
from simulation.motions import about

T_TRUE = pose(rotation_from_vector(np.array([0.3, -0.2, 0.9])), np.array([0.1, 0.2, 0.8]))
CENTRE = np.array([0.0, 0.0, 0.06])


@pytest.mark.parametrize("degrees", [1.0, 77.0, 180.0, 300.0])
def test_turning_a_can_about_its_axis_is_no_error(degrees: float) -> None:
    symmetry = revolution("z", CENTRE)
    assert symmetry.pose_error(T_TRUE @ about("z", degrees, CENTRE), T_TRUE) == pytest.approx((0.0, 0.0), abs=1e-4)


def test_tilting_a_can_is_an_error_of_the_tilt_whatever_its_turn() -> None:
    tilted = T_TRUE @ about("z", 50.0, CENTRE) @ about("x", 7.0, CENTRE)
    assert revolution("z", CENTRE).pose_error(tilted, T_TRUE) == pytest.approx((7.0, 0.0), abs=1e-4)


def test_a_shift_is_an_error_of_its_length() -> None:
    shifted = T_TRUE.copy()
    shifted[0, 3] += 0.03
    for symmetry in (revolution("z", CENTRE), half_turns(CENTRE), Symmetry(centre=CENTRE)):
        assert symmetry.pose_error(shifted, T_TRUE) == pytest.approx((0.0, 3.0), abs=1e-4)


@pytest.mark.parametrize("axis", "xyz")
def test_half_a_turn_of_a_box_about_each_axis_is_no_error_and_a_quarter_is(axis: str) -> None:
    symmetry = half_turns(CENTRE)
    assert symmetry.pose_error(T_TRUE @ about(axis, 180.0, CENTRE), T_TRUE) == pytest.approx((0.0, 0.0), abs=1e-4)
    assert symmetry.pose_error(T_TRUE @ about(axis, 90.0, CENTRE), T_TRUE)[0] == pytest.approx(90.0, abs=1e-4)


def test_without_symmetry_every_turn_counts() -> None:
    assert Symmetry(centre=CENTRE).pose_error(T_TRUE @ turn("z", 180.0), T_TRUE)[0] == pytest.approx(180.0)


def test_a_box_that_was_laid_down_rests_on_the_ground_where_it_was_put() -> None:
    model = ObjectModel(
        "book",
        box((0.1, 0.2, 0.3), Material(np.zeros((2, 2, 3), np.uint8))),
        half_turns(np.array([0, 0, 0.15])),
        rests=(turn("x", 90.0),),
    )
    corners = model.mesh.placed(model.resting(1, yaw=0.4)).bounds
    assert corners[0, 2] == pytest.approx(0.0, abs=1e-6) and corners[1, 2] == pytest.approx(0.2, abs=1e-6)
    np.testing.assert_allclose(corners.mean(0)[:2], 0.0, atol=1e-6)
