# SPDX-License-Identifier: Apache-2.0
"""Rows that are written and deleted are counted."""

from __future__ import annotations

import sqlite3

import numpy as np
import pytest
from registration.samples import box, keyframe

from objreg_ros.memory.codec import require_object
from objreg_ros.memory.counters import Counters
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store_file import bear, connect
from objreg_ros.memory.transaction import delete, rename_landmarks, write_keyframe

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def filled() -> tuple[sqlite3.Connection, Counters]:
    """A table with a keyframe of one object, which is landmark 3."""
    connection, counters = connect(":memory:"), Counters()
    bear(connection)
    stored = keyframe(1, 0, (box("cup", (0.0, 0.0, 1.0)),))
    write_keyframe(connection, counters, stored, [seen.of_landmark(3, np.eye(3)) for seen in sightings_of(stored)])
    return connection, counters


def test_a_row_that_is_written_is_counted(filled: tuple[sqlite3.Connection, Counters]) -> None:
    connection, counters = filled
    assert (counters.keyframe_rows, counters.object_rows, counters.landmark) == (1, 1, 3)
    counters.require_rows(connection)


def test_a_row_that_is_deleted_is_no_longer_counted_and_its_points_go_with_it(
    filled: tuple[sqlite3.Connection, Counters],
) -> None:
    connection, counters = filled
    delete(connection, counters, "object", "WHERE keyframe = ?", (1,))
    assert counters.object_rows == 0 and not connection.execute("SELECT * FROM cloud").fetchall()
    counters.require_rows(connection)


def test_a_renamed_landmark_is_turned_into_the_axes_of_the_one_that_stays(
    filled: tuple[sqlite3.Connection, Counters],
) -> None:
    rename_landmarks(filled[0], {3: Merge(into=2, R_into_old=QUARTER)})
    (row,) = filled[0].execute("SELECT * FROM object").fetchall()
    require_object(row)
    assert row["landmark"] == 2
    assert np.allclose(np.frombuffer(row["R_landmark_session"]).reshape(3, 3), QUARTER)
