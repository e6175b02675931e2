# SPDX-License-Identifier: Apache-2.0
"""Tests of what the truth says of poses."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector


def test_an_error_at_a_point_is_how_far_that_point_is_moved_too_far() -> None:
    from pose_figures import error_at

    turned = pose(rotation_from_vector(np.radians([0.0, 0.0, 90.0])), np.zeros(3))
    degrees, centimetres = error_at(turned, np.eye(4), np.array([1.0, 0.0, 0.0]))
    assert degrees == pytest.approx(90.0) and centimetres == pytest.approx(100.0 * np.sqrt(2.0))
    assert error_at(turned, np.eye(4), np.zeros(3))[1] == pytest.approx(0.0)


def test_errors_drawn_from_a_covariance_have_a_normalised_square_of_six_on_average() -> None:
    from pose_figures import nees

    rng = np.random.default_rng(0)
    sigma = np.array([0.01, 0.02, 0.03, 0.001, 0.002, 0.003])
    truth = pose(rotation_from_vector(np.array([0.3, -0.2, 0.1])), np.array([1.0, 2.0, 3.0]))
    found = []
    for _ in range(2000):
        e = sigma * rng.standard_normal(6)
        T = pose(rotation_from_vector(-e[3:]) @ truth[:3, :3], truth[:3, 3] - e[:3])
        found.append(nees(T, truth, np.diag(sigma**2)))
    assert np.mean(found) == pytest.approx(6.0, abs=0.25)
