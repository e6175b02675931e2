# SPDX-License-Identifier: Apache-2.0
"""Tests of the refinement on shape and grey at once."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.registrar.direct import finish
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.prepared import Prepared, prepare

from .rooms import keyframe, seen_from

PARAMS = RegistrarParams()
WALL = (("room", (-9.0, -9.0, -9.0), (2.0, 9.0, 9.0)),)
FRONT = seen_from(0.0, height=0.75)


def wall(T_world_camera: np.ndarray, seed: int) -> Prepared:
    return prepare(keyframe(T_world_camera, WALL, noise=0.0005, seed=seed), PARAMS)


@pytest.mark.parametrize("shift", [(0.05, 0.0, 0.0), (0.0, -0.05, 0.0), (0.03, 0.03, 0.0)])
def test_a_shift_along_a_bare_wall_is_found_by_its_pattern(shift: tuple[float, float, float]) -> None:
    truth = pose(np.eye(3), np.array(shift))
    T, grey = finish(wall(FRONT @ truth, 1), wall(FRONT, 2), np.eye(4), PARAMS)
    rotation, distance = pose_error(T, truth)
    assert rotation < 0.3 and distance < 0.7
    assert np.linalg.eigvalsh(grey)[0] > 0


def test_a_turn_about_the_line_of_sight_is_found_both_ways() -> None:
    truth = pose(rotation_from_vector(np.array([0.0, 0.0, 0.03])), np.zeros(3))
    a, b = wall(FRONT @ truth, 1), wall(FRONT, 2)
    assert pose_error(finish(a, b, np.eye(4), PARAMS)[0], truth)[0] < 0.3
    assert pose_error(finish(b, a, np.eye(4), PARAMS)[0], inverse(truth))[0] < 0.3
