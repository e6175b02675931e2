# SPDX-License-Identifier: Apache-2.0
"""Tests of what holds a pose where the surfaces let it slide."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.certainty import observability
from objreg_ros.registration.certainty.observability import (
    CLEAR_MARGIN,
    HOPE,
    PERTURBATIONS_M,
    SIGMA_SHARE,
    _peaks,
    better_pose,
    margin_under_perturbation,
    regularising_information,
    split_directions,
)
from objreg_ros.registration.certainty.perturbation import perturbed
from objreg_ros.registration.prepare.prepared import Prepared, prepare
from registration.rooms import ROOM, keyframe, seen_from

PARAMS = RegistrarParams()
WALL = (("room", (-9.0, -9.0, -9.0), (2.0, 9.0, 9.0)),)
TABLE = (ROOM[0], *(box for box in ROOM if box[0] not in ("shelf", "cupboard", "stool")))
TRUTH = inverse(seen_from(20.0)) @ seen_from(0.0)
SIDEWAYS = np.eye(6)[:1]


def views(boxes: tuple, *angles: float) -> list[Prepared]:
    return [prepare(keyframe(seen_from(a), boxes, grey=False, seed=k), PARAMS) for k, a in enumerate(angles)]


def test_what_stands_on_a_table_holds_it() -> None:
    free, regularised = split_directions(*views(TABLE, 0.0, 20.0), TRUTH, SIDEWAYS, 1.0)
    assert free.shape == (0, 6) and regularised.shape == (1, 6)
    assert (
        min(abs(regularised[0, 0] - SIGMA_SHARE * distance) for distance in PERTURBATIONS_M) < 1e-9
        and not regularised[0, 1:].any()
    )


def test_a_turn_about_what_was_seen_is_as_long_as_its_rim_moves() -> None:
    source, target = views(TABLE, 0.0, 20.0)
    lever, extent = transform(TRUTH, source.middle) - TRUTH[:3, 3], 1.2
    about = np.concatenate([-np.cross(target.up, lever), target.up])
    free, regularised = split_directions(source, target, TRUTH, about[None], extent)
    assert len(free) == 0 and len(regularised) == 1
    assert (
        min(abs(np.linalg.norm(regularised[0, 3:]) * extent - SIGMA_SHARE * distance) for distance in PERTURBATIONS_M)
        < 1e-9
    )


def test_nothing_holds_a_bare_wall() -> None:
    wall = prepare(keyframe(seen_from(0.0, height=0.75), WALL, grey=False), PARAMS)
    along = (inverse(seen_from(0.0, height=0.75))[:3, :3] @ [0.0, 1.0, 0.0]).tolist()
    degenerate = np.array([[*along, 0.0, 0.0, 0.0]])
    free, regularised = split_directions(wall, wall, np.eye(4), degenerate, 1.0)
    assert np.array_equal(free, degenerate) and regularised.shape == (0, 6)


def test_a_pose_that_the_views_do_not_like_is_free_everywhere() -> None:
    wrong = TRUTH @ pose(np.eye(3), np.array([0.0, 0.0, 0.8]))
    free, regularised = split_directions(*views(TABLE, 0.0, 20.0), wrong, SIDEWAYS, 1.0)
    assert len(free) == 1 and len(regularised) == 0


def test_views_resist_a_perturbation_along_a_table_and_not_along_a_bare_wall() -> None:
    known = np.diag([0.06**2, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8])
    assert margin_under_perturbation(*views(TABLE, 0.0, 20.0), TRUTH, known) > CLEAR_MARGIN
    wall = prepare(keyframe(seen_from(0.0, height=0.75), WALL, grey=False), PARAMS)
    along = inverse(seen_from(0.0, height=0.75))[:3, :3] @ [0.0, 1.0, 0.0]
    C = 1e-8 * np.eye(6)
    C[:3, :3] += 0.06**2 * np.outer(along, along)
    assert margin_under_perturbation(wall, wall, np.eye(4), C) < CLEAR_MARGIN


def test_a_position_that_views_with_grey_hold_is_known_better_and_one_without_is_not() -> None:
    C = np.diag([0.2**2, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8])
    grey = [prepare(keyframe(seen_from(a), TABLE, seed=k), PARAMS) for k, a in enumerate((0.0, 20.0))]
    added = regularising_information(*grey, TRUTH, C)
    assert np.linalg.inv(np.linalg.inv(C) + added)[0, 0] <= (SIGMA_SHARE * PERTURBATIONS_M[0]) ** 2
    assert not regularising_information(*views(TABLE, 0.0, 20.0), TRUTH, C).any()


def test_what_views_say_of_a_direction_counts_once(monkeypatch: pytest.MonkeyPatch) -> None:
    C = np.diag([0.2**2, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8])
    grey = [prepare(keyframe(seen_from(a), TABLE, seed=k), PARAMS) for k, a in enumerate((0.0, 20.0))]
    regularising = []
    for sigma in (0.1, 1e-3):  # of the smaller they are asked on and on
        monkeypatch.setattr(observability, "DOUBTFUL_SIGMA_M", sigma)
        regularising.append(regularising_information(*grey, TRUTH, C)[0, 0])
    assert regularising[0] > 0.0 and regularising[1] == pytest.approx(regularising[0], rel=0.05)


def test_nothing_is_held_by_a_perturbation_that_is_longer_than_may_steady(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observability, "HOLDING_PERTURBATION_M", 0.0)
    C = np.diag([0.2**2, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8])
    grey = [prepare(keyframe(seen_from(a), TABLE, seed=k), PARAMS) for k, a in enumerate((0.0, 20.0))]
    assert not regularising_information(*grey, TRUTH, C).any()


def test_peaks_are_what_no_neighbour_exceeds_the_best_first_hopeful_and_aside_from_the_middle() -> None:
    V = np.full((9, 9), -1.0, np.float32)
    V[4, 4], V[3, 4] = 0.0, 0.9  # the pose itself, and beside it
    V[1, 1], V[7, 2], V[7, 3], V[1, 7] = 0.9 * -HOPE, 0.5, 0.4, 1.1 * -HOPE
    assert _peaks(V.ravel(), 9) == [7 * 9 + 2, 1 * 9 + 1]


def test_a_pose_that_came_to_rest_beside_the_truth_is_left_for_it() -> None:
    pair = [prepare(keyframe(seen_from(a), TABLE, seed=k), PARAMS) for k, a in enumerate((0.0, 20.0))]
    across = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    C = np.diag([0.05**2, 0.04**2, 1e-6, 1e-8, 1e-8, 1e-8])
    found = better_pose(*pair, perturbed(TRUTH, across), C)
    assert found is not None and pose_error(found, TRUTH)[1] < 1.0
    assert better_pose(*pair, TRUTH, C) is None


def test_a_pose_that_came_to_rest_turned_about_the_objects_is_left_for_the_truth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    source, target = (prepare(keyframe(seen_from(a), TABLE, seed=k), PARAMS) for k, a in enumerate((0.0, 20.0)))
    middle = transform(TRUTH, source.centroids.mean(axis=0))
    R = rotation_from_vector(np.radians(6.0) * target.up)
    turned = pose(R, middle - R @ middle) @ TRUTH
    known = np.diag([1e-4] * 3 + [1e-8] * 3)
    found = better_pose(source, target, turned, known)
    assert found is not None and pose_error(found, TRUTH)[0] < 0.5
    monkeypatch.setattr(observability, "SEARCH_TURNS_DEG", ())
    assert better_pose(source, target, turned, known) is None


def test_nothing_is_preferred_without_grey() -> None:
    wrong = perturbed(TRUTH, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert better_pose(*views(TABLE, 0.0, 20.0), wrong, np.diag([0.05**2] * 3 + [1e-8] * 3)) is None
