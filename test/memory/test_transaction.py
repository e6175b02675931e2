# SPDX-License-Identifier: Apache-2.0
"""Rows that are written and deleted are booked."""

from __future__ import annotations

import sqlite3

import numpy as np
import pytest
from registration.samples import box, keyframe

from objreg_ros.memory.checksum import require_light
from objreg_ros.memory.codec import keyframe_row, object_row
from objreg_ros.memory.counters import Counters, count
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store_file import bear, connect
from objreg_ros.memory.transaction import OBJECTS, delete, rename_landmarks, write

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def filled() -> tuple[sqlite3.Connection, Counters]:
    """A table with a keyframe of one object, which is landmark 3."""
    connection, counters = connect(":memory:"), Counters()
    bear(connection)
    stored = keyframe(1, 0, (box("cup", (0.0, 0.0, 1.0)),))
    (sighting,) = (seen.of_landmark(3, np.eye(3)) for seen in sightings_of(stored))
    write(connection, counters, "keyframe", keyframe_row(stored))
    write(connection, counters, "object", object_row(1, stored.objects[0], sighting))
    return connection, counters


def booked(connection: sqlite3.Connection, counters: Counters) -> bool:
    """Whether the counters say what is in the table of objects."""
    return (counters.object_rows, counters.object_seals) == count(connection, "object")


def test_a_row_that_is_written_is_in_the_books(filled: tuple[sqlite3.Connection, Counters]) -> None:
    assert filled[1].object_rows == 1 and booked(*filled)


def test_a_row_that_is_deleted_is_taken_out_of_them(filled: tuple[sqlite3.Connection, Counters]) -> None:
    delete(*filled, "object", "WHERE keyframe = ?", (1,))
    assert filled[1].object_rows == 0 and booked(*filled)


def test_a_renamed_landmark_is_turned_into_the_axes_of_the_one_that_stays(
    filled: tuple[sqlite3.Connection, Counters],
) -> None:
    rename_landmarks(*filled, {3: Merge(into=2, R_into_old=QUARTER)})
    (row,) = filled[0].execute(OBJECTS).fetchall()
    require_light(row)
    assert row["landmark"] == 2 and booked(*filled)
    assert np.allclose(np.frombuffer(row["R_landmark_session"]).reshape(3, 3), QUARTER)
