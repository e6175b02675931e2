# SPDX-License-Identifier: Apache-2.0
"""Tests of the two-way visibility score."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse
from objreg_ros.registration.shapes.shape import upright_motion
from objreg_ros.registration.shapes.silhouette import BESIDE, INSIDE, RIM
from objreg_ros.registration.shapes.silhouette_score import (
    COUNTS,
    HIDDEN,
    INLIERS,
    VIOLATIONS,
    climb,
    score_silhouettes,
    tally,
    weights_of,
)
from objreg_ros.sensor import NEAR_M, silhouette_tolerance
from registration.drawn_shapes import BOX, ELL, from_side
from registration.shapes.test_upright_search import shape_of


def truth(angle: float) -> np.ndarray:
    return inverse(from_side(0.0)) @ from_side(angle)


def test_the_truth_looks_alike_and_a_wrong_turn_does_not() -> None:
    source, target = shape_of(ELL, 30.0, 1), shape_of(ELL, 0.0, 2)
    motion = upright_motion(source, target, truth(30.0))
    assert score_silhouettes(source, target, motion) > 0.5
    assert score_silhouettes(source, target, np.add(motion, (np.pi / 2, 0, 0, 0))) < 0.0


def test_a_shift_into_free_space_costs_more_than_it_can_gain() -> None:
    source, target = shape_of(BOX, 0.0, 1), shape_of(BOX, 0.0, 2)
    motion = upright_motion(source, target, truth(0.0))
    scores = [score_silhouettes(source, target, np.add(motion, (0, 0, shift, 0))) for shift in (0.0, 0.02, 0.05)]
    assert scores[0] > 0.7 and scores[0] > scores[1] > scores[2] and scores[2] < 0.0


def test_what_lies_a_little_aside_looks_alike_within_reach_and_what_is_turned_does_not() -> None:
    source, target = shape_of(ELL, 30.0, 1), shape_of(ELL, 0.0, 2)
    motion = upright_motion(source, target, truth(30.0))
    aside, turned = np.add(motion, (0, 0.03, -0.03, 0.01)), np.add(motion, (np.pi / 2, 0, 0, 0))
    assert score_silhouettes(source, target, aside) < 0.0
    assert score_silhouettes(source, target, aside, reach=0.06) > 0.9 * score_silhouettes(source, target, motion)
    assert score_silhouettes(source, target, turned, reach=0.06) < 0.0
    assert score_silhouettes(source, target, np.add(motion, (0, 0.2, 0, 0)), reach=0.06) < 0.0


def test_both_ways_say_the_same() -> None:
    source, target = shape_of(ELL, 40.0, 1), shape_of(ELL, 0.0, 2)
    forward = score_silhouettes(source, target, upright_motion(source, target, truth(40.0)))
    backward = score_silhouettes(target, source, upright_motion(target, source, inverse(truth(40.0))))
    assert abs(forward - backward) < 1e-6


def test_a_climb_never_ends_lower() -> None:
    source, target = shape_of(ELL, 30.0, 1), shape_of(ELL, 0.0, 2)
    start = np.add(upright_motion(source, target, truth(30.0)), (0.06, 0.01, -0.01, 0.0))
    motion = start.copy()
    extent = 0.5 * (source.extent + target.extent)
    steps = np.array([0.05, 0.012, 0.012, 0.0])
    reached = climb(source.kernel_arrays, target.kernel_arrays, motion, extent, weights_of(), 400, steps, 8)
    assert reached > score_silhouettes(source, target, start) + 0.1
    assert abs(reached - score_silhouettes(source, target, motion)) < 1e-9


@pytest.mark.parametrize(
    ("behind", "on", "facing", "what", "counted"),
    [
        (0.0, INSIDE, -1.0, INLIERS, 1.0),
        (0.0, RIM, -1.0, INLIERS, 1.0),
        (0.0, INSIDE, 1.0, INLIERS, 0.0),
        (-0.1, INSIDE, -1.0, VIOLATIONS, 1.0),
        (-0.1, BESIDE, -1.0, VIOLATIONS, 1.0),
        (-0.1, RIM, -1.0, VIOLATIONS, 0.0),
        (0.1, INSIDE, -1.0, HIDDEN, 0.0),
        (0.2, INSIDE, -1.0, HIDDEN, 0.5),
        (0.4, INSIDE, -1.0, HIDDEN, 1.0),
        (0.1, BESIDE, -1.0, HIDDEN, 0.5),
        (0.1, RIM, -1.0, HIDDEN, 0.5),
    ],
)
def test_a_point_is_on_the_surface_floats_or_is_hidden_the_more_the_deeper_it_lies(
    behind: float, on: int, facing: float, what: int, counted: float
) -> None:
    depth, mask, out = np.ones((3, 3), np.float32), np.full((3, 3), on, np.uint8), np.zeros(COUNTS)
    point, normal = np.array([[0.0, 0.0, 1.0 + behind]], np.float32), np.array([[0.0, 0.0, facing]], np.float32)
    grey = np.zeros((3, 3), np.float32)
    camera, tolerance = np.array([1.0, 1.0, 1.5, 1.5]), silhouette_tolerance(1.0)
    tally(point, normal, grey[0, :1], 1, np.eye(4)[:3], depth, mask, grey, camera, tolerance, 0.2, out)
    assert out[what] == pytest.approx(counted, abs=1e-5)
    assert out[[INLIERS, VIOLATIONS, HIDDEN]].sum() == pytest.approx(counted, abs=1e-5)


@pytest.mark.parametrize("depth", [0.3, NEAR_M, 1.0, 3.0])
def test_how_far_a_point_may_be_off_grows_from_the_depth_where_noise_is_least(depth: float) -> None:
    tolerance = silhouette_tolerance(1.0)
    within = tolerance[0] + tolerance[1] * (depth - NEAR_M) ** 2
    image, mask, camera = (
        np.zeros((3, 3), np.float32),
        np.full((3, 3), INSIDE, np.uint8),
        np.array([1.0, 1.0, 1.5, 1.5]),
    )
    point, normal = np.array([[0.0, 0.0, depth]], np.float32), np.array([[0.0, 0.0, -1.0]], np.float32)
    for share, what in ((0.99, INLIERS), (1.01, HIDDEN), (-0.99, INLIERS), (-1.01, VIOLATIONS)):
        behind, out = np.full((3, 3), depth - share * within, np.float32), np.zeros(COUNTS)
        tally(point, normal, image[0, :1], 1, np.eye(4)[:3], behind, mask, image, camera, tolerance, 1e-3, out)
        assert out[what] > 0.0 and out[[INLIERS, VIOLATIONS, HIDDEN]].sum() == out[what]
