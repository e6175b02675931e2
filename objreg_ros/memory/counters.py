# SPDX-License-Identifier: Apache-2.0
"""The counters of a store: one row that says how many rows there are of everything, and which ids were given.

A row that is missing has no checksum that could be wrong. So the counters are written with every change.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

from objreg_ros.memory.checksum import Row, require_sealed, sealed

TABLES = ("keyframe", "object", "closure", "veto")
MOST_IDS = {**dict.fromkeys(TABLES, 2**53), "landmark": 2**32 - 2}  # u32 on the wire


@dataclass(slots=True)
class Counters:
    """The highest ids that were given, the rows there are, and how many keyframes were forgotten for the limit."""

    keyframe: int = 0
    object: int = 0
    closure: int = 0
    veto: int = 0
    landmark: int = 0
    keyframe_rows: int = 0
    object_rows: int = 0
    closure_rows: int = 0
    veto_rows: int = 0
    forgotten: int = 0

    def next(self, what: str) -> int:
        """An id that none ever had; ValueError where they are used up."""
        given = int(getattr(self, what))
        if given >= MOST_IDS[what]:
            raise ValueError(f"expected ids of {what}s up to {MOST_IDS[what]}, got {given}: they are used up")
        return given + 1

    def give_landmark(self, given: int) -> None:
        """Count the id of a landmark; ValueError for one that no message could hold."""
        if given > MOST_IDS["landmark"]:
            raise ValueError(f"expected ids of landmarks up to {MOST_IDS['landmark']}, got {given}: they are used up")
        self.landmark = max(self.landmark, given)

    def emptied(self) -> Counters:
        """Those of a store in which nothing is, but where the same ids were given."""
        return Counters(**{what: getattr(self, what) for what in MOST_IDS})

    def enter(self, table: str, number: int) -> None:
        """Count a row that is written under that number."""
        setattr(self, table, max(getattr(self, table), number))
        self.change(table, 1)

    def change(self, table: str, rows: int) -> None:
        """Count so many rows more."""
        setattr(self, f"{table}_rows", getattr(self, f"{table}_rows") + rows)

    def write(self, transaction: sqlite3.Connection) -> None:
        """Put them into the store."""
        row = sealed("counters", {"id": 1, **asdict(self)})
        names = ", ".join(row)
        transaction.execute(
            f"REPLACE INTO counters ({names}) VALUES ({', '.join('?' * len(row))})", tuple(row.values())
        )

    def require_rows(self, connection: sqlite3.Connection, tables: Sequence[str] = TABLES) -> None:
        """ValueError unless the tables have as many rows as were counted."""
        for table in tables:
            expected = getattr(self, f"{table}_rows")
            (found,) = connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()
            if found != expected:
                raise ValueError(f"expected {expected} {table}s, got {found}: the store is damaged")


def read_counters(connection: sqlite3.Connection) -> Counters:
    """The counters of a store. ValueError if they are not there, damaged, or do not agree with what there is."""
    row = counters_row(connection, "counters")
    require_sealed("the counters", "counters", row)
    counters = Counters(**{field.name: row[field.name] for field in fields(Counters)})
    counters.require_rows(connection)
    return counters


def counters_row(connection: sqlite3.Connection, table: str) -> Row:
    """The one row of the table of counters; ValueError if there is another number of them."""
    rows = connection.execute(f"SELECT * FROM {table}").fetchall()
    if len(rows) != 1:
        raise ValueError(f"expected one row of counters, got {len(rows)}: the store is damaged")
    return {**rows[0]}
