# SPDX-License-Identifier: Apache-2.0
"""Tests of the view score of a perturbed pose."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose_error, rotation_from_vector, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.certainty.observability import CLEAR_MARGIN
from objreg_ros.registration.certainty.perturbation import PerturbedScore, perturbed, square_grid, turned_about
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.score.view_score import PHOTOMETRIC_POINTS, score_views
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
TRUTH = inverse(seen_from(20.0)) @ seen_from(0.0)
ACROSS = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])


def perturbed_score(grey: bool = True) -> PerturbedScore:
    views = [prepare(keyframe(seen_from(a), grey=grey, seed=k), PARAMS) for k, a in enumerate((0.0, 20.0))]
    return PerturbedScore(*views, TRUTH)


def test_a_perturbation_moves_the_camera_where_it_stands() -> None:
    moved = perturbed(TRUTH, np.array([0.1, 0.0, 0.0, 0.0, 0.0, np.radians(2.0)]))
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
    np.testing.assert_allclose(square_grid(0.1, 1)[:4], [[-0.1, -0.1], [0.0, -0.1], [0.1, -0.1], [-0.1, 0.0]])
    assert len(square_grid(0.05, 4)) == 81 and np.array_equal(square_grid(0.05, 0), [[0.0, 0.0]])
    np.testing.assert_allclose(square_grid(0.05, 4)[40], 0.0)


def test_the_truth_falls_whichever_way_it_is_perturbed_and_the_farther_the_more() -> None:
    here = perturbed_score()
    assert 0.0 < here.least_margin(0.3 * ACROSS[None]) < here.least_margin(ACROSS[None])


def test_of_two_ways_the_one_that_is_liked_more_counts() -> None:
    here = perturbed_score()
    ways = [here.least_margin(way[None]) for way in (ACROSS, -ACROSS)]
    assert here.margin(ACROSS) == min(ways) < max(ways)


def test_of_many_motions_the_one_that_is_liked_most_counts_though_not_all_are_looked_at_closely() -> None:
    here, rng = perturbed_score(), np.random.default_rng(5)
    motions = rng.uniform(-0.1, 0.1, (12, 6))
    assert here.least_margin(motions) == min(here.least_margin(motion[None]) for motion in motions)


def test_no_perturbation_is_no_fall() -> None:
    assert perturbed_score().least_margin(np.zeros((1, 6))) == pytest.approx(0.0, abs=1e-9)


def test_a_fall_is_never_less_than_that_of_the_images_own_bands() -> None:
    views = [prepare(keyframe(seen_from(a), seed=k), PARAMS).sight for k, a in enumerate((0.0, 20.0))]
    own, other = score_views(*views, np.array([TRUTH, perturbed(TRUTH, ACROSS)]), PHOTOMETRIC_POINTS)
    assert perturbed_score().least_margin(ACROSS[None]) >= own - other


def test_views_without_grey_are_asked_for_free_space_alone() -> None:
    assert perturbed_score(grey=False).margin(ACROSS) > CLEAR_MARGIN
