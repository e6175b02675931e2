# SPDX-License-Identifier: Apache-2.0
"""The surer one gives gravity."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.segmenter.gravity.gravity_choice import choose_gravity
from objreg_ros.sensor import gravity_confidence, gravity_sigma_deg

UP = np.array([0.0, -1.0, 0.0])


def tilted(degrees: float) -> np.ndarray:
    return np.array([0.0, -np.cos(np.radians(degrees)), -np.sin(np.radians(degrees))])


def test_an_imu_that_is_surer_wins_and_one_that_is_less_sure_does_not() -> None:
    choice = choose_gravity(UP, 0.8, tilted(2.0), 0.85)
    assert choice.source == "imu" and choice.up is UP and choice.confidence == gravity_confidence(0.8)
    assert choice.disagreement_deg == pytest.approx(2.0)
    choice = choose_gravity(UP, 8.0, tilted(2.0), 0.96)
    assert choice.source == "picture" and choice.confidence == 0.96 and choice.up == pytest.approx(tilted(2.0))


def test_a_picture_that_contradicts_the_imu_loses_however_sure_it_is() -> None:
    choice = choose_gravity(UP, 0.8, tilted(60.0), 1.0)
    assert choice.source == "imu" and choice.disagreement_deg == pytest.approx(60.0)


def test_alone_an_imu_gives_gravity_unless_it_knows_next_to_nothing() -> None:
    assert choose_gravity(UP, 0.8, None, 0.0)[2:] == ("imu", None)
    assert choose_gravity(UP, 80.0, None, 0.0) == (None, 0.0, "nothing", None)
    assert choose_gravity(UP, 80.0, tilted(1.0), 0.2).source == "picture"


def test_a_deviation_and_its_confidence_are_converted_back_and_forth() -> None:
    assert gravity_confidence(0.5) == gravity_confidence(0.01) == 1.0
    assert gravity_confidence(np.inf) == gravity_confidence(np.nan) == 0.0 and gravity_sigma_deg(0.0) == 90.0
    sure = np.linspace(0.3, 1.0, 50)
    sigmas = np.array([gravity_sigma_deg(c) for c in sure])
    assert (np.diff(sigmas) < 0).all()
    assert [gravity_confidence(s) for s in sigmas] == pytest.approx(sure)
