# SPDX-License-Identifier: Apache-2.0
"""The turn between two frames from small pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import scene_view

from objreg_ros.data.frames import View
from objreg_ros.geometry import pose, rotation_angle, rotation_from_vector
from objreg_ros.keyframes.turn import LastPicture, small_pictures, turn_between


def turned(x: float, y: float, z: float) -> np.ndarray:
    """A turn by so many degrees about each axis of the camera, where it stands."""
    return pose(rotation_from_vector(np.radians([x, y, z])), np.zeros(3))


def error_deg(found: np.ndarray, true: np.ndarray) -> float:
    return float(np.degrees(rotation_angle(true[:3, :3].T @ found[:3, :3])))


@pytest.mark.parametrize("degrees", [(0, 8, 0), (-6, 0, 0), (0, 0, 10), (4, -5, 6)])
def test_a_turn_is_found_to_a_degree(degrees: tuple[float, float, float]) -> None:
    T = turned(*degrees)
    R, difference = turn_between(small_pictures(scene_view(T)), small_pictures(scene_view()))
    assert error_deg(R, T) < 1.0 and difference < 8.0


def test_a_brighter_picture_did_not_turn() -> None:
    view = scene_view()
    R, difference = turn_between(small_pictures(replace(view, grey=view.grey + np.uint8(25))), small_pictures(view))
    assert error_deg(R, np.eye(4)) < 0.2 and difference < 2.0


def test_a_guess_is_gone_on_from_and_pictures_that_do_not_overlap_give_nothing() -> None:
    pictures = small_pictures(scene_view())
    R, _ = turn_between(small_pictures(scene_view(turned(0, 14, 0))), pictures, turned(0, 12, 0)[:3, :3])
    assert error_deg(R, turned(0, 14, 0)) < 1.0
    assert turn_between(pictures, pictures, turned(0, 90, 0)[:3, :3])[1] == np.inf


def test_a_fast_turn_is_distinguished_from_a_slow_one() -> None:
    last = LastPicture()
    assert last.next(scene_view()) == (None, False)  # nothing came before
    slow, fast = last.next(scene_view(turned(0, 1, 0))), last.next(scene_view(turned(0, 7, 0)))
    assert fast.is_fast and not slow.is_fast
    assert error_deg(fast.T_last_frame, turned(0, 6, 0)) < 1.0 and not fast.T_last_frame[:3, 3].any()


def test_two_places_are_no_turn() -> None:
    last = LastPicture()
    last.set_first(scene_view())
    noise = np.random.default_rng(1).integers(0, 255, (120, 160)).astype(np.uint8)
    checks = np.kron(noise[::20, ::20], np.ones((20, 20), np.uint8))
    assert last.next(replace(scene_view(), grey=checks)) == (None, False)


def test_without_grey_and_without_texture_nothing_is_fast() -> None:
    view = scene_view()
    last = LastPicture()
    last.set_first(replace(view, grey=None))
    assert last.next(scene_view(turned(0, 8, 0))) == (None, False)
    flat: View = replace(view, grey=np.full_like(view.grey, 90))
    last.set_first(flat)
    assert not last.next(flat).is_fast
