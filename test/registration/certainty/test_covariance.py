# SPDX-License-Identifier: Apache-2.0
"""Covariance: floored, scaled, and open where the data are."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector, skew
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.certainty import covariance
from objreg_ros.registration.certainty.covariance import NEAREST, covariance_of, spread_of, worst_translation
from registration.samples import candidate

PARAMS = RegistrarParams(covariance_scale=4.0, covariance_calibration=0.0)


@pytest.fixture(autouse=True)
def round_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Constants of which a test can say what comes of them."""
    for name, value in {
        "SCALE_GROWTH": 0.0,
        "REFERENCE_RMSE_M": 0.01,
        "LEAST_SIGMA_M": 0.01,
        "LEAST_SIGMA_DEG": 0.5,
        "DEGENERATE_SIGMA_M": 0.5,
        "DEGENERATE_SIGMA_DEG": 60.0,
    }.items():
        monkeypatch.setattr(covariance, name, value)


def what_calibration_adds(T: np.ndarray, middle: np.ndarray, params: RegistrarParams) -> np.ndarray:
    """The covariance of a pose that is known else, less its floor."""
    found = candidate(T, information=1e15 * np.eye(6))
    found = replace(found, alignment=replace(found.alignment, middle=middle))
    return covariance_of(found, params) - spread_of(found.alignment)


def test_much_information_ends_at_the_floor() -> None:
    C = covariance_of(candidate(information=1e12 * np.eye(6)), PARAMS)
    assert np.sqrt(np.diag(C)) == pytest.approx([0.01] * 3 + [np.radians(0.5)] * 3, rel=1e-3)


def test_little_information_is_scaled() -> None:
    C = covariance_of(candidate(information=100.0 * np.eye(6)), PARAMS)
    assert C[0, 0] == pytest.approx(4.0 / 100.0 + 0.01**2)


def test_no_information_is_a_large_covariance_and_not_an_error() -> None:
    C = covariance_of(candidate(information=np.zeros((6, 6))), PARAMS)
    assert np.isfinite(C).all()
    assert np.diag(C) == pytest.approx([4.0 + 0.01**2] * 3 + [4.0 + np.radians(0.5) ** 2] * 3)


def test_a_free_axis_is_open_and_the_others_are_not() -> None:
    yaw = np.zeros((1, 6))
    yaw[0, 4] = 1.0
    C = covariance_of(candidate(information=1e9 * np.eye(6), degenerate=yaw), PARAMS)
    assert np.sqrt(C[4, 4]) > np.radians(50) and np.sqrt(C[3, 3]) < np.radians(1)


def test_a_slide_shows_in_the_worst_translation() -> None:
    slide = np.array([[0.6, 0.8, 0, 0, 0, 0]])
    C = covariance_of(candidate(information=1e9 * np.eye(6), degenerate=slide), PARAMS)
    assert worst_translation(C) == pytest.approx(0.5, rel=0.01)


def test_what_the_views_alone_hold_is_open_by_as_much_as_they_say() -> None:
    regularised = np.array([[0.03, 0.04, 0, 0, 0, 0]])
    C = covariance_of(candidate(information=1e9 * np.eye(6), regularised=regularised), PARAMS)
    assert worst_translation(C) == pytest.approx(np.hypot(0.05, 0.01), rel=0.01)


def test_a_wrong_calibration_is_a_share_of_the_motion_about_what_was_seen() -> None:
    params = PARAMS.replaced(covariance_calibration=0.05)
    T = pose(np.eye(3), np.array([0.4, 0.0, 0.0]))
    middle = np.array([0, 0, 2.0])
    C = what_calibration_adds(T, middle, params)
    about_middle = np.eye(6)
    about_middle[:3, 3:] = -skew(middle - T[:3, 3])
    sigma = np.sqrt(np.diag(about_middle @ C @ about_middle.T))
    assert sigma == pytest.approx([0.05 * 0.4] * 3 + [0.05 * np.sin(0.4 / 2.0)] * 3, rel=1e-6)
    assert np.allclose(what_calibration_adds(np.eye(4), middle, params), 0.0)


def test_a_slide_that_turns_is_open_as_a_turn() -> None:
    around = np.array([[0.6, 0.0, 0.0, 0.0, 0.8, 0.0]])
    C = covariance_of(candidate(information=1e9 * np.eye(6), degenerate=around), PARAMS)
    assert around[0] @ C @ around[0] == pytest.approx(np.radians(60.0) ** 2, rel=1e-3)


def test_nothing_that_was_seen_counts_as_nearer_than_a_camera_sees() -> None:
    params, near = PARAMS.replaced(covariance_calibration=0.05), np.array([0.0, 0.0, 0.1])
    T = pose(np.eye(3), np.array([0.15, 0.0, 0.0]))
    C = what_calibration_adds(T, near, params)
    assert np.sqrt(np.diag(C)[3:]) == pytest.approx([0.05 * np.sin(0.15 / NEAREST)] * 3)


@pytest.mark.parametrize("angle", [90.0, 135.0, 180.0])
def test_a_wrong_calibration_turns_by_no_more_than_its_share(angle: float) -> None:
    params = PARAMS.replaced(covariance_calibration=0.05)
    R = rotation_from_vector(np.array([0.0, np.radians(angle), 0.0]))
    middle = np.array([0, 0, 2.0])
    C = what_calibration_adds(pose(R, middle - R @ middle), middle, params)
    assert np.sqrt(np.diag(C)[3:]) == pytest.approx([0.05] * 3, rel=0.02)


def test_the_scale_is_of_what_is_published_and_not_of_what_decides() -> None:
    found = candidate(information=1e3 * np.eye(6))
    once, twice = (covariance_of(found, PARAMS.replaced(covariance_scale=scale)) for scale in (1.0, 2.0))
    assert np.allclose(spread_of(found.alignment), once)
    assert np.allclose(twice - once, 1e-3 * np.eye(6))


def test_a_pose_that_the_views_like_less_or_that_fits_worse_is_known_less(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(covariance, "SCALE_GROWTH", 2.0)
    monkeypatch.setattr(covariance, "REFERENCE_RMSE_M", 0.005)
    params = PARAMS.replaced(covariance_scale=1.0)
    floor = covariance_of(candidate(information=1e15 * np.eye(6)), params)
    liked, disliked = (candidate(information=1e3 * np.eye(6), score=score) for score in (1.0, 0.5))
    rough = replace(liked, alignment=replace(liked.alignment, rmse=0.02))
    variances = [float((covariance_of(one, params) - floor)[0, 0]) for one in (liked, disliked, rough)]
    assert variances == pytest.approx([2e-3, 2e-3 * np.e, 4e-3], rel=1e-3)


def test_the_file_that_states_the_calibration_holds_the_values_of_the_code(repository: Path) -> None:
    text = (repository / "config" / "covariance.yaml").read_text(encoding="utf-8")
    values = dict(re.findall(r"^    (\w+): ([\d.]+)$", text, re.MULTILINE))
    assert values.keys() == {"covariance_scale", "covariance_calibration"}
    assert {name: getattr(RegistrarParams(), name) for name in values} == {k: float(v) for k, v in values.items()}
