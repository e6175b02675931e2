# SPDX-License-Identifier: Apache-2.0
"""Odometry: what is expected between two keyframes, and how certain that is."""

from __future__ import annotations

import numpy as np
import pytest
from registration.samples import moved

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.keyframes.odometry import TURNS_DEG_S, TravelledPath
from objreg_ros.registrar.params import RegistrarParams

PARAMS = RegistrarParams(
    odometry_translation_noise=0.03, odometry_drift=0.1, odometry_rotation_noise=1.0, odometry_rotation_drift=0.01
)
TURNED = pose(rotation_from_vector(np.radians([0.0, 90.0, 0.0])), np.array([1.0, 0.0, 0.0]))


def test_a_way_adds_up_what_was_gone_and_turned_from_pose_to_pose() -> None:
    path = TravelledPath(np.eye(4))
    for T in (TURNED, moved(3.0), moved(2.5)):
        path.go(T)
    assert path.travelled == pytest.approx(1.0 + 2.0 + 0.5) and path.turned == pytest.approx(90.0 + 90.0)


def test_a_way_is_as_long_as_it_may_have_been_while_nothing_was_seen() -> None:
    path = TravelledPath(np.eye(4))
    path.lose(3.0, 2.0)
    assert path.travelled == pytest.approx(6.0) and path.turned == pytest.approx(3.0 * TURNS_DEG_S)


def test_a_pose_is_near_the_last_one_in_place_and_turn() -> None:
    path, aside = (
        TravelledPath(np.eye(4)),
        pose(rotation_from_vector(np.radians([0.0, 2.0, 0.0])), np.array([0.1, 0.0, 0.0])),
    )
    assert path.is_near(aside, 0.11, 2.1)
    assert not path.is_near(aside, 0.09, 2.1) and not path.is_near(aside, 0.11, 1.9)
