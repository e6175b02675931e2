# SPDX-License-Identifier: Apache-2.0
"""Where a landmark is by its sightings."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.memory.landmark_position import position_of


def test_one_sighting_is_as_sure_as_a_third_of_the_reach() -> None:
    xyz, covariance = position_of(np.array([[1.0, 2.0, 3.0]]), np.array([1.0]))
    assert xyz.tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(covariance, 0.1**2 * np.eye(3))  # 0.1 m and a fifth of 1 m, by 3


def test_many_sightings_have_their_mean_and_their_scatter() -> None:
    sigmas, rng = np.array([0.01, 0.02, 0.04]), np.random.default_rng(1)
    xyz, covariance = position_of(rng.normal(size=(2000, 3)) * sigmas + (5.0, 0.0, 1.0), np.full(2000, 0.5))
    np.testing.assert_allclose(xyz, (5.0, 0.0, 1.0), atol=0.004)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sigmas, rtol=0.1)


def test_what_was_moved_is_where_it_was_seen_last() -> None:
    seen = np.array([[0.0, 0.0, 0.0]] * 9 + [[2.0, 0.0, 0.0], [2.02, 0.0, 0.0]])
    xyz, covariance = position_of(seen, np.full(11, 0.5))
    assert xyz.tolist() == pytest.approx([2.01, 0.0, 0.0]) and np.sqrt(covariance[0, 0]) < 0.1


def test_no_sighting_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 position"):
        position_of(np.zeros((0, 3)), np.zeros(0))
