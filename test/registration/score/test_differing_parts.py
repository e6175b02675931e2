# SPDX-License-Identifier: Apache-2.0
"""What of a view speaks for one of two places that fit alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.registration.score.differing_parts import Parts, differing_parts
from registration.samples import moved, scene_view

HERE = np.eye(4)
ROWS, COLUMNS = slice(20, 36), slice(30, 50)


def with_poster(view: View, shade: int) -> View:
    """The view with a plain patch on the wall."""
    assert view.grey is not None
    grey = view.grey.copy()
    grey[ROWS, COLUMNS] = shade
    return replace(view, grey=grey)


def with_box(view: View, metres: float) -> View:
    """The view with something so far before the wall."""
    xyz = view.xyz.copy()
    xyz[ROWS, COLUMNS] *= ((xyz[ROWS, COLUMNS, 2] - metres) / xyz[ROWS, COLUMNS, 2])[..., None]
    return replace(view, xyz=xyz)


def test_equal_places_are_spoken_for_by_nothing() -> None:
    view = scene_view()
    assert differing_parts(view, view, HERE, view, HERE) == Parts(0, 0)


def test_a_poster_speaks_for_the_place_that_has_it() -> None:
    bright, dark = (with_poster(scene_view(), shade) for shade in (230, 20))
    found = differing_parts(bright, bright, HERE, dark, HERE)
    assert found.for_first > 100 and found.for_second == 0
    assert differing_parts(bright, dark, HERE, bright, HERE) == Parts(*found[::-1])


def test_it_does_where_the_pose_is_a_little_off_and_the_light_has_changed() -> None:
    bright, dark = (with_poster(scene_view(), shade) for shade in (230, 20))
    dimmed = replace(dark, grey=dimmer(dark.grey))
    found = differing_parts(bright, replace(bright, grey=dimmer(bright.grey)), moved(0.01), dimmed, moved(-0.01))
    assert found.for_first > 50 and found.for_second == 0


def dimmer(grey: Array | None) -> Array:
    assert grey is not None
    return np.asarray(0.8 * grey.astype(float), np.uint8)


def test_a_thing_where_a_place_has_free_space_speaks_for_the_other() -> None:
    empty = scene_view()
    full = with_box(empty, 0.6)
    found = differing_parts(full, full, HERE, empty, HERE)
    assert found.for_first > 100 and found.for_second == 0


def test_a_place_that_looks_different_everywhere_is_not_compared() -> None:
    view = with_poster(scene_view(), 230)
    noise = np.random.default_rng(0).integers(0, 256, view.xyz.shape[:2]).astype(np.uint8)
    assert differing_parts(view, view, HERE, replace(view, grey=noise), HERE) == Parts(0, 0)
    assert differing_parts(view, replace(view, grey=None), HERE, view, HERE) == Parts(0, 0)
