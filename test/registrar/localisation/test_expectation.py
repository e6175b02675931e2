# SPDX-License-Identifier: Apache-2.0
"""What a view of a wall two metres ahead shows of objects that should be before it."""

from __future__ import annotations

import numpy as np
from registration.samples import CAMERA

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import back_project
from objreg_ros.registrar.localisation.expectation import Look, Place, Shown, looks_of


def wall(depth: Array | float) -> View:
    image = np.broadcast_to(np.asarray(depth, float), (120, 160)).copy()
    xyz = back_project(image, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy).astype(np.float32)
    return View(xyz=xyz, grey=None, intrinsics=CAMERA)


def cup(x: float = 0.0, z: float = 1.0, sigma_m: float = 0.03) -> Place:
    return Place(7, "cup", np.array([x, 0.0, z]), 0.2, sigma_m)


def look(place: Place, *shown: Shown, depth: Array | float = 2.0) -> Look:
    (found,) = looks_of([place], shown, wall(depth))
    return found


def test_an_object_whose_place_is_looked_through_is_missing() -> None:
    assert look(cup()) is Look.MISSING


def test_one_that_stands_there_is_seen_and_another_label_there_is_not_it() -> None:
    assert look(cup(), Shown("cup", np.array([0.05, 0.0, 1.0])), depth=0.9) is Look.SEEN
    assert look(cup(), Shown("book", np.array([0.0, 0.0, 1.0])), depth=0.9) is Look.NOTHING


def test_what_is_hidden_or_stands_before_something_near_says_nothing() -> None:
    assert look(cup(), depth=0.7) is Look.NOTHING
    assert look(cup(), depth=1.1) is Look.NOTHING


def test_what_is_outside_or_behind_or_cut_off_by_the_picture_says_nothing() -> None:
    for place in (cup(x=5.0), cup(z=-1.0), cup(z=9.0)):
        assert look(place) is Look.OUTSIDE
    assert look(cup(x=0.57)) is Look.NOTHING


def test_what_is_not_measured_says_nothing() -> None:
    assert look(cup(), depth=np.nan) is Look.NOTHING


def test_a_vague_place_must_be_looked_through_all_over_and_a_vaguer_one_says_nothing() -> None:
    edge = np.full((120, 160), 2.0)
    edge[:, 90:] = 1.0  # something stands 10 cm beside the middle
    assert look(cup(sigma_m=0.0), depth=edge) is Look.MISSING
    assert look(cup(sigma_m=0.1), depth=edge) is Look.NOTHING
    assert look(cup(sigma_m=0.5)) is Look.OUTSIDE


def test_without_known_objects_nothing_is_expected() -> None:
    assert looks_of([], [], wall(2.0)) == []
