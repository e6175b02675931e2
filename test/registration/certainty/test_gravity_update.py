# SPDX-License-Identifier: Apache-2.0
"""What gravity says of a pose."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_ros.geometry import pose, pose_error, rotation_angle, rotation_from_vector, skew
from objreg_ros.registration.certainty.gravity_update import (
    POSE_SIGMA_DEG,
    UPRIGHT_SIGMA_DEG,
    gravity_error,
    gravity_update,
)

UP = np.array([0.0, -0.8, -0.6])
TRUE = pose(rotation_from_vector(0.9 * UP), np.array([0.8, 0.1, 0.3]))  # it turns about gravity
MIDDLE = np.array([0.0, 0.5, 2.5])  # of what was seen, in the target's camera
TILT = np.radians(1.5)


def seen(up: np.ndarray | None, sigma_deg: float = 0.5, weight: float = 1.0) -> Any:
    return SimpleNamespace(up=up, up_sigma_deg=sigma_deg, up_weight=weight)


def tilted_about_what_was_seen() -> np.ndarray:
    """The true pose with an error that surfaces hardly see: turned about their middle by `TILT`."""
    turn = rotation_from_vector(TILT * np.array([1.0, 0.0, 0.0]))
    return pose(turn, MIDDLE - turn @ MIDDLE) @ TRUE


def spread() -> np.ndarray:
    """The covariance of a pose that may be turned about the middle of what was seen by 2 degrees, 1 mm beside."""
    lever = np.eye(6)
    lever[:3, 3:] = skew(MIDDLE - TRUE[:3, 3])
    return lever @ np.diag([1e-6] * 3 + [np.radians(2.0) ** 2] * 3) @ lever.T


def test_a_tilted_pose_is_levelled_and_brought_back_with_its_position() -> None:
    found = gravity_update(seen(UP), seen(UP), tilted_about_what_was_seen(), spread())
    assert found is not None
    before, after = (pose_error(T, TRUE) for T in (tilted_about_what_was_seen(), found[0]))
    assert before[1] > 5.0
    assert after[0] < 0.3 * before[0] and after[1] < 0.3 * before[1]


def test_a_pose_that_is_known_stays() -> None:
    sure = np.diag([1e-6] * 3 + [np.radians(0.05) ** 2] * 3)
    found = gravity_update(seen(UP), seen(UP), tilted_about_what_was_seen(), sure)
    assert found is not None
    assert pose_error(found[0], tilted_about_what_was_seen())[0] < 0.03 * np.degrees(TILT)


def test_gravity_of_little_weight_hardly_counts() -> None:
    much, little = (
        gravity_update(*(seen(UP, weight=weight) for _ in range(2)), tilted_about_what_was_seen(), spread())
        for weight in (1.0, 0.05)
    )
    assert much is not None and little is not None
    moved = [rotation_angle(found[0][:3, :3] @ tilted_about_what_was_seen()[:3, :3].T) for found in (much, little)]
    assert moved[1] < 0.5 * moved[0]


def test_gravity_says_nothing_of_a_turn_about_itself() -> None:
    found = gravity_update(seen(UP), seen(UP), TRUE, spread())
    assert found is not None
    about = np.concatenate([np.zeros(3), UP])
    assert about @ found[1] @ about == pytest.approx(0.0, abs=1e-9)
    across = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    assert across @ found[1] @ across == pytest.approx(0.5 / np.radians(0.5) ** 2)


@pytest.mark.parametrize("weights", [(0.2, 1.0), (1.0, 0.2)])
def test_what_is_said_is_as_doubtful_as_both_gravities_together(weights: tuple[float, float]) -> None:
    found = gravity_update(*(seen(UP, weight=weight) for weight in weights), TRUE, spread())
    assert found is not None
    across = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    assert across @ found[1] @ across == pytest.approx(1.0 / ((1.0 / 0.2 + 1.0) * np.radians(0.5) ** 2))


@pytest.mark.parametrize("ups", [(None, UP), (UP, None)])
def test_gravity_that_is_unknown_says_nothing(ups: tuple[np.ndarray | None, np.ndarray | None]) -> None:
    assert gravity_update(*(seen(up) for up in ups), TRUE, spread()) is None


def test_the_error_of_gravity_is_an_angle_and_how_many_deviations_that_is() -> None:
    error = gravity_error(
        seen(UP, 1.0), seen(UP, 2.0), pose(rotation_from_vector(np.radians([3.0, 0, 0])), np.zeros(3))
    )
    assert error.degrees == pytest.approx(3.0)
    assert error.sigmas == pytest.approx(3.0 / np.sqrt(1.0 + 4.0 + POSE_SIGMA_DEG**2))


def test_where_gravity_is_unknown_a_camera_is_held_upright_more_or_less() -> None:
    over, aside = (pose(rotation_from_vector(np.radians([0, 0, turn])), np.zeros(3)) for turn in (180.0, 90.0))
    lost, turned = (gravity_error(seen(None), seen(None), T) for T in (over, aside))
    assert lost.degrees is None and turned.degrees is None
    assert lost.sigmas == pytest.approx(180.0 / (np.sqrt(2.0) * UPRIGHT_SIGMA_DEG), rel=0.01) and lost.sigmas > 3.5
    assert turned.sigmas < 2.0


@pytest.mark.parametrize("unknown", ["source", "target"])
def test_without_gravity_nothing_is_said(unknown: str) -> None:
    views = [seen(None if unknown == name else UP) for name in ("source", "target")]
    assert gravity_update(*views, TRUE, spread()) is None


@pytest.mark.parametrize("angle", [0.0, 3.0, 90.0, 180.0])
def test_the_error_of_gravity_is_the_angle_between_what_the_two_views_felt(angle: float) -> None:
    tilted, level = seen(rotation_from_vector(np.radians([angle, 0.0, 0.0])) @ (0.0, -1.0, 0.0)), seen(-np.eye(3)[1])
    T = pose(rotation_from_vector(np.radians([0.0, 40.0, 0.0])), np.ones(3))  # about what falls
    assert gravity_error(tilted, level, T).degrees == pytest.approx(angle, abs=1e-5)
