# SPDX-License-Identifier: Apache-2.0
"""Tests of the two-way look."""

from __future__ import annotations

import numpy as np

from objreg_ros.registration.prepare.views import prepare_sight
from registration.rooms import keyframe, seen_from


def test_the_first_points_of_a_sight_are_a_fair_sample() -> None:
    points = prepare_sight(keyframe(seen_from(0.0)).view, 4.0, 3.0).points
    assert np.abs(points[:1000].mean(axis=0) - points.mean(axis=0)).max() < 0.1
