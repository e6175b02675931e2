# SPDX-License-Identifier: Apache-2.0
"""Tests of what the views think of a push."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose_error, rotation_from_vector, transform
from objreg_ros.registration.certainty.perturbation import Stand, pushed, square, turned_about
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.score.view_score import rank
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
TRUTH = inverse(seen_from(20.0)) @ seen_from(0.0)
ACROSS = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])


def stand(grey: bool = True) -> Stand:
    views = [prepare(keyframe(seen_from(a), grey=grey, seed=k), PARAMS) for k, a in enumerate((0.0, 20.0))]
    return Stand(*views, TRUTH, PARAMS)


def test_a_push_moves_the_camera_where_it_stands() -> None:
    moved = pushed(TRUTH, np.array([0.1, 0.0, 0.0, 0.0, 0.0, np.radians(2.0)]))
    rotation, centimetres = pose_error(moved, TRUTH)
    assert rotation == pytest.approx(2.0) and centimetres == pytest.approx(10.0)


def test_a_pose_is_turned_about_a_place_that_stays_where_it_is() -> None:
    place, up = np.array([0.3, 0.1, 1.2]), np.array([0.0, -1.0, 0.0])
    (turned,) = turned_about(TRUTH, place, up, np.radians([15.0]))
    there = transform(inverse(TRUTH), place)
    np.testing.assert_allclose(transform(turned, there), place, atol=1e-12)
    assert pose_error(turned, TRUTH)[0] == pytest.approx(15.0)
    np.testing.assert_allclose(
        turned[:3, :3] @ TRUTH[:3, :3].T, rotation_from_vector(np.radians(15.0) * up), atol=1e-12
    )


def test_a_square_is_walked_row_by_row_about_its_middle() -> None:
    np.testing.assert_allclose(square(0.1, 1)[:4], [[-0.1, -0.1], [0.0, -0.1], [0.1, -0.1], [-0.1, 0.0]])
    assert len(square(0.05, 4)) == 81 and np.array_equal(square(0.05, 0), [[0.0, 0.0]])
    np.testing.assert_allclose(square(0.05, 4)[40], 0.0)


def test_the_truth_falls_whichever_way_it_is_pushed_and_the_farther_the_more() -> None:
    here = stand()
    assert 0.0 < here.least_fall(0.3 * ACROSS[None]) < here.least_fall(ACROSS[None])


def test_of_two_ways_the_one_that_is_liked_more_counts() -> None:
    here = stand()
    ways = [here.least_fall(way[None]) for way in (ACROSS, -ACROSS)]
    assert here.fall(ACROSS) == min(ways) < max(ways)


def test_of_many_motions_the_one_that_is_liked_most_counts_though_not_all_are_looked_at_closely() -> None:
    here, rng = stand(), np.random.default_rng(5)
    motions = rng.uniform(-0.1, 0.1, (12, 6))
    assert here.least_fall(motions) == min(here.least_fall(motion[None]) for motion in motions)


def test_no_push_is_no_fall() -> None:
    assert stand().least_fall(np.zeros((1, 6))) == pytest.approx(0.0, abs=1e-9)


def test_a_fall_is_never_less_than_that_of_the_images_own_bands() -> None:
    views = [prepare(keyframe(seen_from(a), seed=k), PARAMS).sight for k, a in enumerate((0.0, 20.0))]
    own, other = rank(*views, np.array([TRUTH, pushed(TRUTH, ACROSS)]), PARAMS, PARAMS.grey_points)
    assert stand().least_fall(ACROSS[None]) >= own - other


def test_views_without_grey_are_asked_for_free_space_alone() -> None:
    assert stand(grey=False).fall(ACROSS) > PARAMS.rival_margin
