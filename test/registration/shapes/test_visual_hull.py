# SPDX-License-Identifier: Apache-2.0
"""Tests of the perturbation out of seen free space."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse
from objreg_ros.registration.shapes.shape import Shape, upright_motion
from objreg_ros.registration.shapes.visual_hull import clear
from registration.drawn_shapes import BOX, ELL, from_side
from registration.shapes.test_upright_search import shape_of

STEPS = 12


def met(thing: object, angle: float) -> tuple[Shape, Shape, np.ndarray]:
    """Two looks at a thing, and the true motion of one upon the other."""
    source, target = shape_of(thing, angle, 1), shape_of(thing, 0.0, 2)
    return source, target, upright_motion(source, target, inverse(from_side(0.0)) @ from_side(angle))


def certain_violations(source: Shape, target: Shape, motion: np.ndarray) -> float:
    """How far points float under a motion, m in all."""
    return float(clear(source.kernel_arrays, target.kernel_arrays, motion.copy(), 400, 0))


@pytest.mark.parametrize("angle", [60.0, 90.0, 130.0, 170.0])
@pytest.mark.parametrize("aside", [(0.06, 0.0), (-0.06, 0.08), (0.0, -0.06), (0.05, 0.05)])
def test_a_shape_that_stands_aside_is_brought_back_though_they_share_little_surface(
    angle: float, aside: tuple[float, float]
) -> None:
    source, target, truth = met(ELL, angle)
    start = truth + np.array([0.05, *aside, 0.0])
    motion = start.copy()
    clear(source.kernel_arrays, target.kernel_arrays, motion, 100, STEPS)
    assert np.hypot(*(motion - truth)[1:3]) < 0.6 * np.hypot(*aside)
    assert abs(motion[0] - truth[0]) < np.radians(8.0)
    assert certain_violations(source, target, motion) < certain_violations(source, target, start)


def test_the_truth_floats_next_to_nowhere_and_stays() -> None:
    source, target, truth = met(BOX, 90.0)
    motion = truth.copy()
    left = clear(source.kernel_arrays, target.kernel_arrays, motion, 400, STEPS)
    assert left < 0.1
    assert abs(motion[0] - truth[0]) < np.radians(5.0) and np.hypot(*(motion - truth)[1:3]) < 0.01


def test_it_never_floats_more_than_before_and_the_rise_stays() -> None:
    source, target, truth = met(ELL, 70.0)
    for turn in (0.0, 1.0, 2.0, 3.0):
        start = truth + np.array([turn, 0.05, -0.05, 0.01])
        motion = start.copy()
        left = clear(source.kernel_arrays, target.kernel_arrays, motion, 400, STEPS)
        assert left <= certain_violations(source, target, start) + 1e-9
        assert motion[3] == start[3]


def test_both_ways_float_alike() -> None:
    source, target, truth = met(ELL, 70.0)
    T = inverse(from_side(0.0)) @ from_side(70.0)
    back = upright_motion(target, source, inverse(T))
    turn = np.array([[np.cos(back[0]), -np.sin(back[0])], [np.sin(back[0]), np.cos(back[0])]])
    aside = np.array([0.06, -0.03])
    moved = truth + np.array([0.0, *aside, 0.0])
    returned = back - np.array([0.0, *(turn @ aside), 0.0])
    assert certain_violations(source, target, moved) == pytest.approx(
        certain_violations(target, source, returned), rel=1e-3
    )
