# SPDX-License-Identifier: Apache-2.0
"""The changes of a store's tables that are booked: rows written and deleted, landmarks renamed."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.checksum import LIGHT, require_light, sealed_light
from objreg_ros.memory.codec import closure_row
from objreg_ros.memory.counters import Counters, count
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.migration import insert

OLDEST = "WHERE id IN (SELECT id FROM closure ORDER BY id LIMIT ?)"
SESSION = "SELECT COALESCE(MAX(MAX(COALESCE(from_session, -1), COALESCE(to_session, -1))), -1) FROM closure"  # newest
OBJECTS = f"SELECT {', '.join(LIGHT)}, seal FROM object"


def write(transaction: sqlite3.Connection, counters: Counters, table: str, row: Mapping[str, Any]) -> None:
    """Enter a row and count it."""
    insert(transaction, table, row)
    counters.enter(table, row)


def delete(
    transaction: sqlite3.Connection, counters: Counters, table: str, where: str = "", values: Sequence[Any] = ()
) -> None:
    """Delete the rows of a table that ``where`` names, all without it, and count that."""
    rows, seals = count(transaction, table, where, values)
    transaction.execute(f"DELETE FROM {table} {where}", values)
    counters.change(table, -rows, -seals)


def write_closures(
    transaction: sqlite3.Connection, counters: Counters, closures: Iterable[LoopClosure], most: int
) -> None:
    """Enter closures, and forget the oldest of more than ``most``."""
    for closure in closures:
        write(transaction, counters, "closure", closure_row(counters.next("closure"), closure))
    if counters.closure_rows > most:
        delete(transaction, counters, "closure", OLDEST, (counters.closure_rows - most,))


def rename_landmarks(transaction: sqlite3.Connection, counters: Counters, merged: Mapping[int, Merge]) -> None:
    """Make every sighting of the landmarks that are gone one of that which stays."""
    for old, merge in merged.items():
        _rename_landmark(transaction, counters, old, merge)


def _rename_landmark(transaction: sqlite3.Connection, counters: Counters, old: int, merge: Merge) -> None:
    """Make every sighting of a landmark one of that which stays, in its axes."""
    for row in transaction.execute(f"{OBJECTS} WHERE landmark = ?", (old,)).fetchall():
        require_light(row)
        turned = merge.R_into_old @ np.frombuffer(row["R_landmark_session"]).reshape(3, 3)
        new = sealed_light({**row, "landmark": int(merge.into), "R_landmark_session": turned.tobytes()})
        transaction.execute(
            "UPDATE object SET landmark = ?, R_landmark_session = ?, seal = ? WHERE id = ?",
            (new["landmark"], new["R_landmark_session"], new["seal"], row["id"]),
        )
        counters.change("object", 0, new["seal"] - row["seal"])
