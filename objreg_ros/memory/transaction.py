# SPDX-License-Identifier: Apache-2.0
"""The changes of a store's tables that are booked: rows written and deleted, landmarks renamed."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from objreg_ros.memory.books import Books, count
from objreg_ros.memory.checksum import LIGHT, require_light, sealed_light
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.migration import insert

OBJECTS = f"SELECT {', '.join(LIGHT)}, seal FROM object"


def write(transaction: sqlite3.Connection, books: Books, table: str, row: Mapping[str, Any]) -> None:
    """Enter a row and book it."""
    insert(transaction, table, row)
    books.enter(table, row)


def delete(
    transaction: sqlite3.Connection, books: Books, table: str, where: str = "", values: Sequence[Any] = ()
) -> None:
    """Delete the rows of a table that ``where`` names, all without it, and book that."""
    rows, seals = count(transaction, table, where, values)
    transaction.execute(f"DELETE FROM {table} {where}", values)
    books.change(table, -rows, -seals)


def rename_landmark(transaction: sqlite3.Connection, books: Books, old: int, merge: Merge) -> None:
    """Make every sighting of a landmark one of that which stays, in its axes."""
    for row in transaction.execute(f"{OBJECTS} WHERE landmark = ?", (old,)).fetchall():
        require_light(row)
        turned = merge.R_into_old @ np.frombuffer(row["R_landmark_session"]).reshape(3, 3)
        new = sealed_light({**row, "landmark": int(merge.into), "R_landmark_session": turned.tobytes()})
        transaction.execute(
            "UPDATE object SET landmark = ?, R_landmark_session = ?, seal = ? WHERE id = ?",
            (new["landmark"], new["R_landmark_session"], new["seal"], row["id"]),
        )
        books.change("object", 0, new["seal"] - row["seal"])
