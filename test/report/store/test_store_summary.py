# SPDX-License-Identifier: Apache-2.0
"""The survey of a store."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import box, keyframe, moved

from objreg_ros.data.frames import View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.store_file import is_store
from objreg_ros.sensor import KINECT, depth_sigma
from objreg_tools.report.store.store_summary import describe, survey
from report.places import cup_and_book


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A store with two sessions of a cup and a book."""
    return cup_and_book(tmp_path / "place.db")


def test_a_survey_counts_labels_sessions_and_landmarks(place: Path) -> None:
    found = survey(place)
    assert found.labels == {"cup": 3, "book": 3} and found.counts["landmarks"] == 4
    assert [(s["session"], s["keyframes"]) for s in found.sessions] == [(0, 2), (1, 1)]
    assert [(known.label, known.sightings) for known in found.landmarks][:2] == [("cup", 2), ("book", 2)]


def test_a_description_names_what_is_there(place: Path) -> None:
    text = describe(survey(place))
    assert "3 keyframes" in text and "cup 3" in text and "session 0: 2 keyframes, 4 objects in 10.0 s" in text


def test_a_description_states_the_noise_of_the_depth_of_stored_views(tmp_path: Path) -> None:
    rng, store = np.random.default_rng(0), Store(tmp_path / "noisy.db")
    z = 2.0 + 2.0 * depth_sigma(np.full((120, 160), 2.0)) * rng.normal(size=(120, 160))
    for number in (1, 2, 3):
        taken = keyframe(number, 10.0 * number, (box("cup", (0, 0, 1)),), 0, moved(0.0))
        xyz = back_project(z.astype(np.float32), 130.0, 130.0, 80.0, 60.0)
        camera = Intrinsics(fx=130.0, fy=130.0, cx=80.0, cy=60.0, width=160, height=120)
        store.write_keyframe(
            replace(taken, view=View(xyz=xyz, grey=None, intrinsics=camera)), sightings_of(taken), (), {}
        )
    store.close()
    found = survey(tmp_path / "noisy.db")
    assert found.depth_noise == pytest.approx(2.0 / KINECT, rel=0.1)
    assert f"depth noise of the views: {found.depth_noise:.2f} (a Kinect v1 has 1)" in describe(found)


def test_a_store_whose_views_have_too_little_depth_states_no_noise(tmp_path: Path) -> None:
    Store(tmp_path / "empty.db").close()
    found = survey(tmp_path / "empty.db")
    assert found.depth_noise is None and "noise" not in describe(found)


def test_a_store_is_distinguished_from_other_files(place: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no store")
    assert is_store(place)
    assert not is_store(tmp_path / "notes.txt") and not is_store(tmp_path) and not is_store(tmp_path / "nothing")


def test_an_empty_store_has_a_description(tmp_path: Path) -> None:
    Store(tmp_path / "empty.db").close()
    assert "0 keyframes" in describe(survey(tmp_path / "empty.db"))


def test_a_moment_is_given_from_the_begin_of_its_session(place: Path) -> None:
    found = survey(place)
    assert found.moment(found.sightings[2]) == "10.0 s of session 0"
    assert found.moment(found.sightings[-1]) == "0.0 s of session 1"


def test_what_is_no_store_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError):
        survey(tmp_path / "nothing.db")
