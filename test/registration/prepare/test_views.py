# SPDX-License-Identifier: Apache-2.0
"""Tests of a view made ready, and of where it shows an object."""

from __future__ import annotations

import numpy as np

from objreg_ros.registration.keyframe import KeyObject
from objreg_ros.registration.prepare.views import own_pixels, prepare_sight
from registration.rooms import keyframe, seen_from
from registration.samples import cloud
from registration.slab import room


def test_the_first_points_of_a_sight_are_a_fair_sample() -> None:
    points = prepare_sight(keyframe(seen_from(0.0)).view, 4.0, 3.0).points
    assert np.abs(points[:1000].mean(axis=0) - points.mean(axis=0)).max() < 0.1


def test_an_object_is_found_where_a_view_shows_it_with_its_rim_and_no_more() -> None:
    sight, item, shown = room(0.1)
    own = own_pixels(item, sight)
    assert own[shown].all() and own.sum() < 1.15 * shown.sum()


def test_what_stands_before_or_behind_an_object_is_not_it() -> None:
    sight, item, shown = room(0.1)
    for gone in (-0.2, 0.2):
        moved_away = KeyObject(cloud=cloud("monitor", item.cloud.xyz * np.float32(1.0 + gone)))
        assert not own_pixels(moved_away, sight)[shown & (sight.near == sight.far)].any()
