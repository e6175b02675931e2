# SPDX-License-Identifier: Apache-2.0
"""The objects of a store on its map."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import SECOND, box, keyframe, moved

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_tools.report.exports.landmark_places import as_geojson, landmark_places
from objreg_tools.report.exports.placed_keyframes import PlacedKeyframes
from objreg_tools.report.run.camera_map import MappedFrame

UPRIGHT = pose(rotation_from_vector(np.array([-np.pi / 2, 0.0, 0.0])), np.zeros(3))  # z ahead becomes y ahead


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """A cup seen twice, the second time 2 cm farther by odometry that slipped, and a book seen once."""
    store = Store(tmp_path / "place.db")
    for number, (x, cup) in enumerate(((0.0, 1.0), (0.5, 0.52)), start=1):
        shown = (box("cup", (cup, 0.0, 1.0)), box("book", (0.0, 0.0, 2.0), instance=2))[: 1 + (number == 2)]
        made = replace(keyframe(number, number, shown, T_odom_camera=moved(x)), by_odometry=True)
        seen = [s.of_landmark(10 + k, np.eye(3)) for k, s in enumerate(sightings_of(made))]
        store.write_keyframe(made, seen)
    store.close()
    return tmp_path / "place.db"


def placed(store: Path, corrected: float = 0.48) -> PlacedKeyframes:
    at = ((1, 0.0, 0.0), (2, 0.5, corrected))
    return PlacedKeyframes(store, tuple(MappedFrame(k * SECOND, moved(x), moved(x), moved(m)) for k, x, m in at))


def test_landmarks_are_where_the_corrected_keyframes_saw_them(store: Path) -> None:
    cup, book = landmark_places(placed(store), np.eye(4))
    assert (cup.landmark, cup.label, cup.sightings, cup.last_seen_ns) == (10, "cup", 2, 2 * SECOND)
    assert (book.landmark, book.label, book.sightings) == (11, "book", 1)
    np.testing.assert_allclose(cup.xyz, (1.0, 0.0, 1.0), atol=0.006)
    np.testing.assert_allclose(book.xyz, (0.48, 0.0, 2.0), atol=0.006)
    slipped, _ = landmark_places(placed(store, corrected=0.5), np.eye(4))
    assert slipped.xyz[0] - cup.xyz[0] == pytest.approx(0.01) and slipped.covariance[0, 0] > cup.covariance[0, 0]


def test_landmarks_of_a_map_that_was_turned_are_turned(store: Path) -> None:
    _, book = landmark_places(placed(store), UPRIGHT)
    np.testing.assert_allclose(book.xyz, (0.48, 2.0, 0.0), atol=0.006)


def test_what_no_keyframe_of_the_map_shows_is_left_out(store: Path) -> None:
    first = replace(placed(store), frames=placed(store).frames[:1])
    assert [place.label for place in landmark_places(first, np.eye(4))] == ["cup"]


def test_the_json_is_geojson_in_metres(store: Path) -> None:
    said = json.loads(json.dumps(as_geojson(landmark_places(placed(store), UPRIGHT), UPRIGHT)))
    assert said["type"] == "FeatureCollection" and said["unit"] == "m" and np.shape(said["T_level_map"]) == (4, 4)
    cup = said["features"][0]
    assert cup["type"] == "Feature" and cup["id"] == 10 and cup["geometry"]["type"] == "Point"
    assert len(cup["geometry"]["coordinates"]) == 3 and np.shape(cup["properties"]["covariance"]) == (3, 3)
    named = {"label", "covariance", "extent", "sightings", "last_seen_ns", "session", "robot"}
    assert set(cup["properties"]) == named and cup["properties"]["extent"] == pytest.approx(0.17, abs=0.01)
