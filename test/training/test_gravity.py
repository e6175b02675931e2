# SPDX-License-Identifier: Apache-2.0
"""The script that says how far gravity errs."""

from __future__ import annotations

import numpy as np
import pytest

from training.gravity import sigma_deg, tilts


def test_the_deviation_of_either_tilt_is_found_in_angles() -> None:
    tilt = np.random.default_rng(0).normal(0.0, 1.7, (20000, 2))
    assert sigma_deg((tilt**2).sum(axis=1)) == pytest.approx(1.7, rel=0.03)


def test_views_of_a_simulated_room_give_gravity_with_a_confidence() -> None:
    views = tilts(1, 2)
    confidence, squared = next(views)
    assert 0.0 < confidence <= 1.0 and squared < 25.0
