# SPDX-License-Identifier: Apache-2.0
"""Stores of older versions: all that they say, written anew into a store of this one."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from objreg_ros.memory.books import MOST_IDS, Books, read_books
from objreg_ros.memory.checksum import (
    require_head,
    require_keyframe,
    require_object,
    require_sealed,
    sealed,
    sealed_keyframe,
    sealed_object,
)
from objreg_ros.memory.claim import Claim
from objreg_ros.memory.store_file import SCHEMA as NEWEST
from objreg_ros.memory.store_file import SCHEMA_VERSION, bear, check, connect, read_only_uri

LAST = 4  # the last version without checksums
ROBOTLESS = 5  # the last that knew of one robot only
HEAD = ("id", "session", "stamp_ns", "travelled", "by_odometry")  # of a keyframe, in that version
SEALS = ("seal", "whole", "cloud_crc")
ADDED: dict[str, dict[str, Any]] = {  # what a later version says besides, and what that is of an older one
    "keyframe": {"robot": "", "origin": ""},
    "object": {},
    "closure": {"from_robot": "", "to_robot": "", "from_session": None, "to_session": None},
}
SCHEMA = """
CREATE TABLE keyframe (
  id INTEGER PRIMARY KEY AUTOINCREMENT, session INTEGER NOT NULL, stamp_ns INTEGER NOT NULL, frame_id TEXT NOT NULL,
  travelled REAL NOT NULL, turned REAL NOT NULL, T_odom_camera BLOB, by_odometry INTEGER NOT NULL,
  gravity BLOB, gravity_confidence REAL NOT NULL,
  camera TEXT NOT NULL, view BLOB NOT NULL, context BLOB NOT NULL);
CREATE TABLE object (
  id INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL REFERENCES keyframe ON DELETE CASCADE,
  instance INTEGER NOT NULL, landmark INTEGER NOT NULL, label TEXT NOT NULL, score REAL NOT NULL,
  extent REAL NOT NULL, sightings INTEGER NOT NULL, density REAL NOT NULL, position BLOB NOT NULL, camera BLOB NOT NULL,
  R_landmark_session BLOB NOT NULL, descriptor BLOB NOT NULL, cloud BLOB NOT NULL);
CREATE INDEX object_of_keyframe ON object (keyframe);
CREATE INDEX object_of_landmark ON object (landmark);
CREATE TABLE closure (
  id INTEGER PRIMARY KEY, from_ns INTEGER NOT NULL, to_ns INTEGER NOT NULL,
  from_frame_id TEXT NOT NULL, to_frame_id TEXT NOT NULL,
  T_from_to BLOB NOT NULL, covariance BLOB NOT NULL, labels TEXT NOT NULL, evidence TEXT NOT NULL);
CREATE TABLE highest (landmark INTEGER NOT NULL);
INSERT INTO highest VALUES (0);
"""
RENEWALS = {  # what makes of a version the next one
    1: """
ALTER TABLE closure RENAME COLUMN frame_id TO to_frame_id;
ALTER TABLE closure ADD COLUMN from_frame_id TEXT NOT NULL DEFAULT '';
UPDATE closure SET from_frame_id = to_frame_id;
""",
    2: """
UPDATE keyframe SET gravity_confidence = 0.02 * gravity_confidence * gravity_confidence * gravity_confidence;
""",  # it was that of one view: see `gravity_filter`
    3: """
CREATE TABLE highest (landmark INTEGER NOT NULL);
INSERT INTO highest SELECT COALESCE(MAX(landmark), 0) FROM object;
""",
}
KINDS = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}
MOST = 2**53  # of a number in a row but stamps: those that are counted on from must have room
COUNTED = ("id", "session", "keyframe", "landmark")


def renewed(path: Path, beside: Path) -> None:
    """Write what the older store at ``path`` says into an empty file. ValueError if it cannot be understood."""
    with closing(sqlite3.connect(beside)) as target:
        renew(path, target)
        target.row_factory = sqlite3.Row
        read_books(target)
    check(beside)
    with closing(sqlite3.connect(path)) as old:  # a log that stays behind would be taken for the new file's
        old.execute("PRAGMA journal_mode = DELETE").fetchall()


def renew(path: Path, target: sqlite3.Connection) -> None:
    """Write what the older store at ``path`` says into an empty database. ValueError if it cannot be understood."""
    with closing(sqlite3.connect(read_only_uri(path), uri=True)) as source:
        (version,) = source.execute("PRAGMA user_version").fetchone()
        source.row_factory = sqlite3.Row
        _require_parts(source, version)
        if version in (LAST, ROBOTLESS):
            _copy(source, target)
            return
        with closing(sqlite3.connect("")) as between:  # a file of SQLite's own
            between.row_factory = sqlite3.Row
            source.backup(between)
            for old in range(version, LAST):
                between.executescript(f"BEGIN; {RENEWALS[old]} PRAGMA user_version = {old + 1}; COMMIT;")
            _copy(between, target)


def _copy(source: sqlite3.Connection, target: sqlite3.Connection) -> None:
    bear(target)
    with target as transaction:
        books = _given(source)
        for table, sealing in (("keyframe", sealed_keyframe), ("object", sealed_object), ("closure", _sealed_closure)):
            for row in _rows(source, table):
                written = sealing({**row, **ADDED[table]})
                insert(transaction, table, written)
                books.enter(table, written)
                books.landmark = max(books.landmark, row.get("landmark", 0))
        for what in MOST_IDS:
            books.next(what)
        books.write(transaction)


def _given(source: sqlite3.Connection) -> Books:
    """Books of a store without rows, in which the ids of an older one are used up."""
    if _has_seals(source):
        old = read_books(source)
        return Books(keyframe=old.keyframe, object=old.object, closure=old.closure, landmark=old.landmark)
    keyframe = _highest(source, "SELECT COALESCE(MAX(seq), 0) FROM sqlite_sequence WHERE name = 'keyframe'")
    return Books(keyframe=keyframe, landmark=_highest(source, "SELECT landmark FROM highest"))


def _has_seals(source: sqlite3.Connection) -> bool:
    return bool(source.execute("SELECT 1 FROM sqlite_master WHERE name = 'books'").fetchone())


def insert(transaction: sqlite3.Connection, table: str, row: Mapping[str, Any]) -> None:
    """Write a row under its names."""
    names, marks = ", ".join(row), ", ".join("?" * len(row))
    transaction.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))


def _sealed_closure(row: Mapping[str, Any]) -> dict[str, Any]:
    return sealed("closure", row)


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
    if table == "keyframe" and "seal" in row:
        require_head(row, HEAD)
        require_keyframe(row)
    elif table == "object" and "seal" in row:
        require_object(row)
    elif "seal" in row:
        require_sealed(f"closure {row['id']}", "closure", row)
    return {name: value for name, value in row.items() if name not in SEALS}


def _highest(source: sqlite3.Connection, query: str) -> int:
    rows = source.execute(query).fetchall()
    if len(rows) != 1 or not isinstance(rows[0][0], int):
        raise ValueError(f"expected the highest id that was given, got {rows[:2]}: the store is damaged")
    return int(rows[0][0])


def _require_parts(source: sqlite3.Connection, version: int) -> None:
    """ValueError unless a database has the tables, columns and indices of that version, and nothing else."""
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(SCHEMA if version <= LAST else NEWEST)
        if version == ROBOTLESS:
            for table, names in ADDED.items():
                for name in names:
                    model.execute(f"ALTER TABLE {table} DROP COLUMN {name}")
        if version < 4:
            model.execute("DROP TABLE highest")
        if version < 2:
            model.executescript(
                "ALTER TABLE closure DROP COLUMN from_frame_id;"
                "ALTER TABLE closure RENAME COLUMN to_frame_id TO frame_id;"
            )
        wanted, got = _parts(model), _parts(source)
    if wanted != got:
        first = sorted(wanted ^ got)[0]
        raise ValueError(f"expected the tables of a store of version {version}, got another or none: {' '.join(first)}")


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
        connection.execute("BEGIN")  # all that is read is of one moment
        return connection
    if old:
        claim.replace(lambda beside: renewed(path, beside))
    connection = connect(str(path))
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA wal_autocheckpoint = 1")
    return connection
