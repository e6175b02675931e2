# SPDX-License-Identifier: Apache-2.0
"""Smooth noise has the deviation and the correlation that it says, and edges and shadows are where they must be."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.simulation.sensors.fields import edges, shadows, smooth, wandered


@pytest.mark.parametrize("window", [1, 5, 11])
def test_smooth_noise_has_deviation_1_and_a_correlation_that_falls_over_its_window(window: int) -> None:
    field = smooth(np.random.default_rng(1), (480, 640), window)
    assert field.std() == pytest.approx(1.0, abs=0.05) and field[:3].std() == pytest.approx(1.0, abs=0.25)
    for lag in (2, 4, 12):
        expected = max(0.0, 1 - lag / window)
        assert (field[:, lag:] * field[:, :-lag]).mean() == pytest.approx(expected, abs=0.06)
        assert (field[lag:] * field[:-lag]).mean() == pytest.approx(expected, abs=0.06)


def step() -> np.ndarray:
    nearness = np.full((40, 100), 0.5, np.float32)
    nearness[:, 50:] = 1.0
    return nearness


def test_an_edge_is_where_depth_jumps_and_not_where_a_plane_slants() -> None:
    assert np.flatnonzero(edges(step(), 3)[20]).tolist() == list(range(47, 53))
    slanted = np.tile(np.linspace(0.3, 1.2, 100, dtype=np.float32), (40, 1))
    assert not edges(slanted, 3)[:, 4:-4].any()


def test_the_second_camera_does_not_see_as_much_as_parallax_says() -> None:
    hidden = shadows(step(), 20.0)
    assert np.flatnonzero(hidden[3]).tolist() == list(range(41, 50))


def test_edges_that_wander_stay_edges_between_the_same_depths() -> None:
    moved = wandered(step(), 1.0, np.random.default_rng(2))
    assert set(np.unique(moved)) == {0.5, 1.0}
    assert 0.3 < (moved == 1.0).sum(axis=1).std() < 2.0
    assert wandered(step(), 0.0, np.random.default_rng(2)).tolist() == step().tolist()
