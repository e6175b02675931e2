# SPDX-License-Identifier: Apache-2.0
"""`objreg where`: objects of a store by their label."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from registration.samples import box, keyframe, moved

from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_tools.cli.commands.stores.where import command


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """Chairs 1 m and 2 m ahead, the nearer one seen last, and a cup; the camera's y is down."""
    store = Store(tmp_path / "place.db")
    for number, (label, z) in enumerate((("chair", 2.0), ("cup", 1.5), ("chair", 1.0)), start=1):
        made = replace(
            keyframe(number, number, (box(label, (0.0, 0.0, z)),), T_odom_camera=moved(0.0)), by_odometry=True
        )
        store.write_keyframe(made, [s.of_landmark(number, np.eye(3)) for s in sightings_of(made)])
    store.close()
    return tmp_path / "place.db"


def where(*words: object) -> Result:
    return CliRunner().invoke(command, [str(word) for word in words], catch_exceptions=False, standalone_mode=False)


def rows(result: Result) -> list[list[str]]:
    return [line.split() for line in result.stdout.splitlines()[2:]]


def test_the_one_that_was_seen_last_comes_first_with_z_up(store: Path) -> None:
    result = where(store, "Chair")
    assert result.return_value == 0 and [row[0] for row in rows(result)] == ["3", "1"]
    x, y, z = map(float, rows(result)[0][2:5])
    assert (x, y, z) == (pytest.approx(0.0, abs=0.02), pytest.approx(1.0, abs=0.02), pytest.approx(0.0, abs=0.02))


def test_the_nearest_to_a_place_comes_first(store: Path) -> None:
    assert [row[0] for row in rows(where(store, "chair", "--from", 0, 2.1, 0))] == ["1", "3"]
    assert [row[0] for row in rows(where(store, "--from", 0, 2.1, 0))] == ["1", "2", "3"]


def test_the_same_as_json(store: Path, tmp_path: Path) -> None:
    result = where(store, "cup", "--json", "-")
    (cup,) = json.loads(result.stdout)["features"]
    assert cup["id"] == 2 and cup["geometry"]["coordinates"][1] == pytest.approx(1.5, abs=0.02)
    where(store, "--json", tmp_path / "all.json")
    assert len(json.loads((tmp_path / "all.json").read_text())["features"]) == 3


def test_a_label_that_is_not_there_names_those_that_are_and_ends_with_three(store: Path) -> None:
    result = where(store, "sofa")
    assert result.return_value == 3 and result.stderr == "no sofa on the map; there are: chair (2), cup (1)\n"
    Store(store.with_name("empty.db")).close()
    assert "no object on the map; there are: none" in where(store.with_name("empty.db")).stderr
