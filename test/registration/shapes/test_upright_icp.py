# SPDX-License-Identifier: Apache-2.0
"""Tests of the upright ICP."""

from __future__ import annotations

import numpy as np

from objreg_ros.geometry import inverse
from objreg_ros.registration.shapes.shape import upright_motion
from objreg_ros.registration.shapes.upright_icp import settle
from registration.drawn_shapes import ELL, from_side
from registration.shapes.test_upright_search import shape_of


def test_a_motion_settles_at_the_truth() -> None:
    source, target = shape_of(ELL, 15.0, 1), shape_of(ELL, 0.0, 2)
    truth = upright_motion(source, target, inverse(from_side(0.0)) @ from_side(15.0))
    motion = np.add(truth, (0.08, 0.015, -0.015, 0.0))
    pairs = settle(source.xyz, source.normals, 400, target.surface.grid, motion, 0.05, 0.01, 20)
    assert pairs > 100
    assert abs(motion[0] - truth[0]) < np.radians(1.5) and np.abs(motion[1:3] - truth[1:3]).max() < 0.004
    assert motion[3] == truth[3]


def test_far_from_everything_nothing_moves() -> None:
    source, target = shape_of(ELL, 15.0, 1), shape_of(ELL, 0.0, 2)
    motion = np.array([0.0, 2.0, 0.0, 0.0])
    assert settle(source.xyz, source.normals, 400, target.surface.grid, motion, 0.05, 0.01, 20) < 6
    assert motion.tolist() == [0.0, 2.0, 0.0, 0.0]
