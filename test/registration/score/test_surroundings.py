# SPDX-License-Identifier: Apache-2.0
"""A slab before a painted wall: what the views say of where it stands, and what they say without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.registration.prepare.views import Sight, own_pixels, pixels_of
from objreg_ros.registration.score.surroundings import verify_surroundings, without
from objreg_ros.registration.score.view_score import verify
from registration.samples import CAMERA, moved
from registration.slab import room

FROM, TO = -0.15, 0.2  # m: the slab went


@pytest.fixture(scope="module")
def rooms() -> tuple[Sight, Sight, tuple[Array, Array]]:
    """Before and after the slab went, and where each view shows it."""
    (before, there, _), (after, here, _) = room(FROM), room(TO)
    return before, after, (own_pixels(there, before), own_pixels(here, after))


def test_an_object_that_moved_outvotes_the_room_and_is_outvoted_once_it_is_left_out(rooms) -> None:
    before, after, own = rooms
    with_the_slab, with_the_room = moved(TO - FROM), np.eye(4)
    assert verify(before, after, with_the_slab).score > verify(before, after, with_the_room).score
    false, true = (verify_surroundings(before, after, own, T) for T in (with_the_slab, with_the_room))
    assert false is not None and true is not None and true.score > false.score + 0.5
    assert true.correlation is not None and true.correlation > 0.9
    assert false.correlation is not None and false.correlation < 0.3


def test_a_small_object_outvotes_nothing_and_is_not_left_out(rooms) -> None:
    _, after, own = rooms
    (small, item, _), (same, again, _) = room(FROM, 0.2), room(TO, 0.2)
    few = own_pixels(item, small), own_pixels(again, same)
    assert verify_surroundings(small, same, few, np.eye(4)) is None
    assert verify_surroundings(small, after, (few[0], own[1]), np.eye(4)) is not None  # much of one is enough


def test_nothing_is_measured_where_an_object_was_left_out_and_the_rest_is_as_it_was(rooms) -> None:
    before, _, (own, _) = rooms
    rest = without(before, own)
    assert not rest.near[own].any() and not rest.far[own].any()
    assert np.array_equal(rest.near[~own], before.near[~own])
    for points in (rest.points, rest.grey.points):
        assert len(points) and not own[pixels_of(points, before)].any()
    assert [len(band.shades) for band in rest.bands] == [len(rest.points)] * len(rest.bands)
    assert len(rest.grey.shades) == len(rest.grey.points)
    left = ~own[pixels_of(before.points, before)]
    assert np.array_equal(rest.points, before.points[left]) and np.array_equal(rest.shades, before.shades[left])
    assert own[pixels_of(before.points, before)].any()


def test_views_without_grey_are_asked_for_their_depth_alone(rooms) -> None:
    before, after, own = rooms
    blind = replace(before, textured=False)
    found = verify_surroundings(blind, after, own, np.eye(4))
    assert found is not None and found.correlation is None and found.inliers > 0.95


def test_a_camera_that_is_not_that_of_its_points_breaks_nothing(rooms) -> None:
    before, after, own = rooms
    for wrong in (0.5, 2.0):
        other = replace(before, intrinsics=replace(CAMERA, fx=wrong * CAMERA.fx, cx=0.2 * CAMERA.cx))
        assert len(without(other, own[0]).points) < len(other.points)
        assert verify_surroundings(other, after, own, np.eye(4)) is not None
