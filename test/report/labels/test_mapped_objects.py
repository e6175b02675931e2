# SPDX-License-Identifier: Apache-2.0
"""The landmarks of a store on a map, each object once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from registration.samples import SECOND, box, keyframe, moved

from objreg_ros.data.frames import ObjectCloud
from objreg_ros.memory.landmarks import Landmarks
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.report.labels.mapped_objects import MappedObject, ids_of, joined, mapped_objects
from report.labels.scene import square

Shown = tuple[float, int, tuple[ObjectCloud, ...]]  # seconds, session, objects


def objects_of(file: Path, shown: list[Shown], x_of: dict[float, float]) -> tuple[MappedObject, ...]:
    """The objects of keyframes of which the map has those at the seconds of ``x_of``, so far along x."""
    store, landmarks = Store(file), Landmarks(RegistrarParams())
    for number, (seconds, session, objects) in enumerate(shown, start=1):
        taken = keyframe(number, seconds, objects, session, moved(0.0))
        named, merged = landmarks.assign(sightings_of(taken))
        store.write_keyframe(taken, named, [], merged)
        landmarks.add_sightings(named, merged)
    try:
        return mapped_objects(store, {round(s * SECOND): moved(x) for s, x in x_of.items()})
    finally:
        store.close()


def test_a_landmark_has_its_views_where_the_map_puts_them(tmp_path: Path) -> None:
    cup = (box("cup", (0.0, 0.0, 1.0)),)
    (one,) = objects_of(tmp_path / "k.db", [(1.0, 0, cup), (2.0, 0, cup)], {1.0: 0.0, 2.0: 0.5})
    assert one.label == "cup" and [view.stamp_ns for view in one.views] == [SECOND, 2 * SECOND]
    assert np.median(one.views[1].xyz, axis=0) == pytest.approx([0.5, 0.0, 1.0], abs=0.01)
    assert one.views[0].spacing == pytest.approx(0.01)
    assert [view.stamp_ns for view in one.near(2 * SECOND, 1)] == [2 * SECOND]


def test_a_keyframe_that_is_not_on_the_map_is_left_out(tmp_path: Path) -> None:
    cup = (box("cup", (0.0, 0.0, 1.0)),)
    (one,) = objects_of(tmp_path / "k.db", [(1.0, 0, cup), (2.0, 0, cup)], {1.0: 0.0})
    assert len(one.views) == 1


def test_two_landmarks_that_the_map_puts_upon_each_other_are_one_and_a_name_beats_none(tmp_path: Path) -> None:
    shown = [(1.0, 0, (box("thing", (0.0, 0.0, 1.0)),)), (2.0, 1, (box("cup", (0.0, 0.0, 1.0)),))]
    (one,) = objects_of(tmp_path / "k.db", shown, {1.0: 0.0, 2.0: 0.005})
    assert one.label == "cup" and one.landmark == 1 and one.ids == (1, 2) and len(one.views) == 2
    assert ids_of((one,)) == {1: one, 2: one}


def test_two_names_two_places_and_what_one_keyframe_shows_together_stay_two(tmp_path: Path) -> None:
    assert len(joined([square(1, "cup", seconds=(0.0,)), square(2, "book", seconds=(1.0,))])) == 2
    assert len(joined([square(1, seconds=(0.0,)), square(2, at=(0.3, 0.0), seconds=(1.0,))])) == 2
    assert len(joined([square(1, seconds=(0.0, 1.0)), square(2, seconds=(1.0,))])) == 2
