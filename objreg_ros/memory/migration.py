# SPDX-License-Identifier: Apache-2.0
"""Stores of the release before: all that they say, written anew into a store of this version.

Version 5 is that of 0.2.0, the first release: it knew of one robot only.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data.closure_fields import closure_of
from objreg_ros.memory.checksum import (
    require_head,
    require_keyframe,
    require_object,
    require_sealed,
    sealed_keyframe,
    sealed_object,
)
from objreg_ros.memory.claim import Claim
from objreg_ros.memory.codec import closure_row
from objreg_ros.memory.counters import MOST_IDS, read_counters
from objreg_ros.memory.store_file import OLDEST_VERSION, SCHEMA, SCHEMA_VERSION, bear, check, connect, read_only_uri

HEAD = ("id", "session", "stamp_ns", "travelled", "by_odometry")  # of a keyframe, in the version of one robot
SEALS = ("seal", "whole", "cloud_crc")
ADDED: dict[str, dict[str, Any]] = {  # what this version says besides, and what that is of the version of one robot
    "keyframe": {"robot": "", "origin": ""},
    "object": {},
}
CLOSURES = """CREATE TABLE closure (
  id INTEGER PRIMARY KEY, from_ns INTEGER NOT NULL, to_ns INTEGER NOT NULL, from_frame_id TEXT NOT NULL,
  to_frame_id TEXT NOT NULL, T_from_to BLOB NOT NULL, covariance BLOB NOT NULL, labels TEXT NOT NULL,
  evidence TEXT NOT NULL, seal INTEGER NOT NULL)"""  # a column for each field, in the version of one robot
KINDS = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}
MOST = 2**53  # of a number in a row but stamps: those that are counted on from must not overflow
COUNTED = ("id", "session", "keyframe", "landmark")


def renewed(path: Path, beside: Path) -> None:
    """Write what the older store at ``path`` says into an empty file. ValueError if it cannot be understood."""
    with closing(sqlite3.connect(beside)) as target:
        renew(path, target)
        target.row_factory = sqlite3.Row
        read_counters(target)
    check(beside)
    with closing(sqlite3.connect(path)) as old:  # a log that stays behind would be taken for the new file's
        old.execute("PRAGMA journal_mode = DELETE").fetchall()


def renew(path: Path, target: sqlite3.Connection) -> None:
    """Write what the older store at ``path`` says into an empty database. ValueError if it cannot be understood."""
    with closing(sqlite3.connect(read_only_uri(path), uri=True)) as source:
        source.row_factory = sqlite3.Row
        _require_parts(source)
        _copy(source, target)


def _copy(source: sqlite3.Connection, target: sqlite3.Connection) -> None:
    counters = read_counters(source).emptied()  # the ids that were given are used up
    bear(target)
    with target as transaction:
        for table, sealing in (("keyframe", sealed_keyframe), ("object", sealed_object), ("closure", _closure)):
            for row in _rows(source, table):
                written = sealing({**row, **ADDED.get(table, {})})
                insert(transaction, table, written)
                counters.enter(table, written)
                counters.landmark = max(counters.landmark, row.get("landmark", 0))
        for what in MOST_IDS:
            counters.next(what)
        counters.write(transaction)


def insert(transaction: sqlite3.Connection, table: str, row: Mapping[str, Any]) -> None:
    """Write a row under its names."""
    names, marks = ", ".join(row), ", ".join("?" * len(row))
    transaction.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))


def _closure(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row of a closure from one with a column for each field. ValueError where these are no closure's."""
    fields = {name: value for name, value in row.items() if name != "id"}
    for name, shape in (("T_from_to", (4, 4)), ("covariance", (6, 6))):
        fields[name] = np.frombuffer(row[name]).reshape(shape)
    for name in ("labels", "evidence"):
        fields[name] = json.loads(row[name])
    return closure_row(row["id"], closure_of(fields))


def _rows(source: sqlite3.Connection, table: str) -> Iterator[dict[str, Any]]:
    """The rows of a table in the order of their ids, without seals.

    ValueError where one holds what its column does not, or not what was written.
    """
    columns = {name: (kind, needed) for _, name, kind, needed, *_ in source.execute(f"PRAGMA table_info({table})")}
    for values in source.execute(f"SELECT {', '.join(columns)} FROM {table} ORDER BY id"):
        row = dict(zip(columns, values, strict=True))
        for name, (kind, needed) in columns.items():
            if not isinstance(row[name], KINDS[kind]) and (needed or row[name] is not None):
                raise ValueError(f"{table} {row['id']}: {name}: expected {kind}, got {str(row[name])[:40]!r}")
            if name in COUNTED and not -1 <= row[name] < MOST:
                raise ValueError(f"{table} {row['id']}: {name}: expected less than {MOST}, got {row[name]}")
        yield _opened(table, row)


def _opened(table: str, row: dict[str, Any]) -> dict[str, Any]:
    """A row without its seals; ValueError where they are not whole."""
    if table == "keyframe":
        require_head(row, HEAD)
        require_keyframe(row)
    elif table == "object":
        require_object(row)
    else:
        require_sealed(f"closure {row['id']}", "closure", row)
    return {name: value for name, value in row.items() if name not in SEALS}


def _require_parts(source: sqlite3.Connection) -> None:
    """ValueError unless a database has the tables, columns and indices of the older version, and nothing else."""
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(SCHEMA)
        for table, names in ADDED.items():
            for name in names:
                model.execute(f"ALTER TABLE {table} DROP COLUMN {name}")
        model.executescript(f"DROP TABLE closure; {CLOSURES};")
        wanted, got = _parts(model), _parts(source)
    if wanted != got:
        first = sorted(wanted ^ got)[0]
        expected = f"expected the tables of a store of version {OLDEST_VERSION}"
        raise ValueError(f"{expected}, got another or none: {' '.join(first)}")


def _parts(connection: sqlite3.Connection) -> set[tuple[str, str, str, str]]:
    """Kind, name, column and type of all that there is."""
    parts = set()
    for kind, name in connection.execute("SELECT type, name FROM sqlite_master").fetchall():
        quoted = str(name).replace('"', '""')
        columns = connection.execute(f'PRAGMA table_info("{quoted}")').fetchall() if kind == "table" else []
        parts |= {(str(kind), str(name), "", "")} | {(str(kind), str(name), str(c[1]), str(c[2])) for c in columns}
    return parts


def opened(path: Path, claim: Claim | None) -> sqlite3.Connection:
    """A connection to the store at ``path``, as of this version; without a claim to read it only. StoreError if bad."""
    old = check(path) < SCHEMA_VERSION
    if claim is None and old:
        connection = connect("")  # a file of SQLite's own, which goes with it
        renew(path, connection)
        return connection
    if claim is None:
        connection = connect(read_only_uri(path))
        connection.execute("BEGIN")  # all that is read is of one time
        return connection
    if old:
        claim.replace(lambda beside: renewed(path, beside))
    connection = connect(str(path))
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA wal_autocheckpoint = 1")
    return connection
