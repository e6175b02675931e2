# SPDX-License-Identifier: Apache-2.0
"""The counters of a store: one row that says how much there is of everything, and which ids were given.

A row that is missing has no checksum that could be wrong. So the counters hold, of each table, how many rows it has and
the sum of their checksums, and are written with every change.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from objreg_ros.memory.checksum import require_sealed, sealed

TABLES = ("keyframe", "object", "closure")
MOST_IDS = {"keyframe": 2**53, "object": 2**53, "closure": 2**53, "landmark": 2**32 - 2}  # u32 on the wire


@dataclass(slots=True)
class Counters:
    """The highest ids that were given, the rows there are and the sums of their seals, and what was forgotten."""

    keyframe: int = 0
    object: int = 0
    closure: int = 0
    landmark: int = 0
    keyframe_rows: int = 0
    object_rows: int = 0
    closure_rows: int = 0
    keyframe_seals: int = 0
    object_seals: int = 0
    closure_seals: int = 0
    forgotten: int = 0  # keyframes, for the limit on them

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
        return Counters(keyframe=self.keyframe, object=self.object, closure=self.closure, landmark=self.landmark)

    def enter(self, table: str, row: Mapping[str, Any]) -> None:
        """Count a row that is written."""
        setattr(self, table, max(getattr(self, table), row["id"]))
        self.change(table, 1, row["seal"])

    def change(self, table: str, rows: int, seals: int) -> None:
        """Count so many rows more, and the sum of their seals."""
        setattr(self, f"{table}_rows", getattr(self, f"{table}_rows") + rows)
        setattr(self, f"{table}_seals", getattr(self, f"{table}_seals") + seals)

    def write(self, transaction: sqlite3.Connection) -> None:
        """Put them into the store."""
        row = sealed("books", {"id": 1, **asdict(self)})
        names = ", ".join(row)
        transaction.execute(f"REPLACE INTO books ({names}) VALUES ({', '.join('?' * len(row))})", tuple(row.values()))


def read_counters(connection: sqlite3.Connection) -> Counters:
    """The counters of a store. ValueError if they are not there, damaged, or do not agree with what there is."""
    rows = connection.execute("SELECT * FROM books").fetchall()
    if len(rows) != 1:
        raise ValueError(f"expected one row of counters, got {len(rows)}: the store is damaged")
    require_sealed("the counters", "books", rows[0])
    counters = Counters(**{field.name: rows[0][field.name] for field in fields(Counters)})
    for table in TABLES:
        booked, found = (
            (getattr(counters, f"{table}_rows"), getattr(counters, f"{table}_seals")),
            count(connection, table),
        )
        if booked != found:
            raise ValueError(
                f"expected {booked[0]} {table}s with checksums of {booked[1]} in all, got {found[0]} with {found[1]}: "
                "the store is damaged"
            )
    return counters


def count(connection: sqlite3.Connection, table: str, where: str = "", values: Iterable[Any] = ()) -> tuple[int, int]:
    """How many rows there are, and what their seals sum up to."""
    rows, seals = connection.execute(
        f"SELECT COUNT(*), COALESCE(SUM(seal), 0) FROM {table} {where}", tuple(values)
    ).fetchone()
    return rows, seals
