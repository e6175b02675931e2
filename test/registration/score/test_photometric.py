# SPDX-License-Identifier: Apache-2.0
"""Tests of the correlation of grey in the same image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_ros.native import kernels
from objreg_ros.registration.prepare.views import Sight, prepare_sight
from objreg_ros.registration.score.free_space import SHADED, correlation
from objreg_ros.registration.score.photometric import NARROW, WINDOW, compare, correlate_views
from objreg_ros.registration.score.view_score import verify
from registration.rooms import keyframe, seen_from


def sight(angle: float, brightness: float = 1.0) -> Sight:
    view = keyframe(seen_from(angle), seed=round(angle)).view
    assert view.grey is not None
    return prepare_sight(replace(view, grey=(brightness * view.grey).astype(np.uint8)), 4.0, 3.0)


def between(source: float, target: float) -> np.ndarray:
    """T_target_source of two looks at the table."""
    return inverse(seen_from(target)) @ seen_from(source)


def test_a_view_is_its_own_print() -> None:
    assert correlate_views(sight(0.0), sight(0.0), np.eye(4)) > 0.99


@pytest.mark.parametrize("angle", [60.0, 90.0])
def test_a_print_is_known_again_from_the_side_better_than_by_each_image_s_own_bands(angle: float) -> None:
    pair, T = (sight(0.0), sight(angle)), between(0.0, angle)
    own_bands = verify(*pair, T, sample=100_000).correlation
    assert own_bands is not None
    assert correlate_views(*pair, T) > own_bands + 0.1


def test_a_print_that_is_shifted_does_not_correlate() -> None:
    shifted = pose(np.eye(3), np.array([0.08, 0.0, 0.0])) @ between(0.0, 25.0)
    assert correlate_views(sight(0.0), sight(25.0), shifted) < 0.5 * correlate_views(
        sight(0.0), sight(25.0), between(0.0, 25.0)
    )


def test_a_darker_picture_has_the_same_print() -> None:
    bright, dark = (correlate_views(sight(0.0), sight(25.0, by), between(0.0, 25.0)) for by in (1.0, 0.5))
    assert dark == pytest.approx(bright, abs=0.02)


def test_what_is_mirrored_beyond_the_rim_is_of_the_picture_however_small_that_is() -> None:
    mirrored = kernels("photometric").mirrored
    for size in (1, 4, WINDOW // 2, 160):
        seen = [mirrored(place, size) for place in range(-(WINDOW // 2), size + WINDOW // 2)]
        assert min(seen) == 0 and max(seen) == size - 1


def test_both_ways_round_give_the_same_texture() -> None:
    pair, T = (sight(0.0), sight(25.0)), between(0.0, 25.0)
    assert correlate_views(*pair, T) == pytest.approx(correlate_views(*pair[::-1], inverse(T)), abs=1e-6)


def test_views_that_do_not_meet_have_no_texture() -> None:
    away = pose(rotation_from_vector(np.array([0.0, np.pi, 0.0])), np.zeros(3))
    assert correlate_views(sight(0.0), sight(25.0), away) == 0.0


def test_a_narrow_window_sees_a_small_push_better() -> None:
    pair, T = (sight(0.0), sight(25.0)), between(0.0, 25.0)
    perturbed = pose(np.eye(3), np.array([0.03, 0.0, 0.0])) @ T
    fall = [
        correlation(compare(*pair, T, *window)) - correlation(compare(*pair, perturbed, *window))
        for window in ((), (NARROW,))
    ]
    assert fall[1] > fall[0] > 0.0


def test_only_pixels_that_both_see_are_compared() -> None:
    pair, T = (sight(0.0), sight(25.0)), between(0.0, 25.0)
    behind = pose(np.eye(3), np.array([0.0, 0.0, 0.5])) @ T
    assert compare(*pair, behind)[SHADED] < 0.2 * compare(*pair, T)[SHADED]


def test_one_strong_edge_that_many_rooms_have_is_no_print() -> None:
    view = keyframe(seen_from(0.0)).view
    assert view.grey is not None
    bright_side = np.where(np.arange(view.grey.shape[1]) > 80, 200.0, 60.0)
    rooms = [
        replace(view, grey=(bright_side + np.random.default_rng(k).normal(0.0, 12.0, view.grey.shape)).astype(np.uint8))
        for k in range(2)
    ]
    first, second = (prepare_sight(room, 4.0, 3.0) for room in rooms)
    assert correlate_views(first, second, np.eye(4)) < 0.3
    assert correlate_views(first, first, np.eye(4)) > 0.9
