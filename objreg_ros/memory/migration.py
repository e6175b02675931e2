# SPDX-License-Identifier: Apache-2.0
"""Older stores: all that they say, written anew into a store of this version.

Version 5 is that of 0.2.0, the first release: it knew of one robot only. It and version 6 have what a keyframe shows
and the points of objects in the rows of these, and several checksums in a row. Version 7 knows of no vetoes.
"""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data.closure_fields import closure_of
from objreg_ros.memory.checksum import checksum, checksum_of, require_same, require_sealed, sealed
from objreg_ros.memory.claim import Claim
from objreg_ros.memory.codec import closure_row
from objreg_ros.memory.counters import MOST_IDS, Counters, counters_row, read_counters
from objreg_ros.memory.store_file import SCHEMA, SCHEMA_VERSION, bear, check, connect, read_only_uri

ROBOT = {"robot": "", "origin": ""}  # of a keyframe of the version of one robot
HEADS = {  # columns of a keyframe that have a checksum of their own, by version
    5: ("id", "session", "stamp_ns", "travelled", "by_odometry"),
    6: ("id", "session", "stamp_ns", "robot", "origin", "travelled", "by_odometry"),
}
LIGHT = (  # of an object, all but its points
    *("id", "keyframe", "instance", "landmark", "label", "score", "extent", "sightings", "density"),
    *("position", "camera", "R_landmark_session", "descriptor", "cloud_crc"),
)
SEALS = ("seal", "whole", "cloud_crc", "checksum")
MOVED = {"keyframe": ("scene", {"view": "view", "context": "context"}), "object": ("cloud", {"cloud": "points"})}
"""Columns of older versions that are in a table of their own now, and their names there."""

BESIDE = ("scene", "cloud")  # tables that version 7 has, too
OLD_TABLES = ("keyframe", "object", "closure")  # that are counted
MOST_BLOB = 1 << 26  # bytes
WITHOUT_VETOES = "DROP TABLE veto; ALTER TABLE counters DROP COLUMN veto; ALTER TABLE counters DROP COLUMN veto_rows;"
TABLES_6 = """
CREATE TABLE keyframe (
  id INTEGER PRIMARY KEY, robot TEXT NOT NULL, origin TEXT NOT NULL, session INTEGER NOT NULL,
  stamp_ns INTEGER NOT NULL, frame_id TEXT NOT NULL,
  travelled REAL NOT NULL, turned REAL NOT NULL, T_odom_camera BLOB, by_odometry INTEGER NOT NULL,
  gravity BLOB, gravity_confidence REAL NOT NULL,
  camera TEXT NOT NULL, seal INTEGER NOT NULL, whole INTEGER NOT NULL, view BLOB NOT NULL, context BLOB NOT NULL);
CREATE TABLE object (
  id INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL, instance INTEGER NOT NULL, landmark INTEGER NOT NULL,
  label TEXT NOT NULL, score REAL NOT NULL, extent REAL NOT NULL, sightings INTEGER NOT NULL, density REAL NOT NULL,
  position BLOB NOT NULL, camera BLOB NOT NULL, R_landmark_session BLOB NOT NULL, descriptor BLOB NOT NULL,
  cloud_crc INTEGER NOT NULL, seal INTEGER NOT NULL, cloud BLOB NOT NULL);
CREATE INDEX object_of_keyframe ON object (keyframe);
CREATE INDEX object_of_landmark ON object (landmark);
CREATE TABLE closure (
  id INTEGER PRIMARY KEY, from_session INTEGER, to_session INTEGER, fields TEXT NOT NULL, seal INTEGER NOT NULL);
CREATE TABLE books (
  id INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL, object INTEGER NOT NULL, closure INTEGER NOT NULL,
  landmark INTEGER NOT NULL, keyframe_rows INTEGER NOT NULL, object_rows INTEGER NOT NULL,
  closure_rows INTEGER NOT NULL, keyframe_seals INTEGER NOT NULL, object_seals INTEGER NOT NULL,
  closure_seals INTEGER NOT NULL, forgotten INTEGER NOT NULL, seal INTEGER NOT NULL);
"""
CLOSURES_5 = """CREATE TABLE closure (
  id INTEGER PRIMARY KEY, from_ns INTEGER NOT NULL, to_ns INTEGER NOT NULL, from_frame_id TEXT NOT NULL,
  to_frame_id TEXT NOT NULL, T_from_to BLOB NOT NULL, covariance BLOB NOT NULL, labels TEXT NOT NULL,
  evidence TEXT NOT NULL, seal INTEGER NOT NULL)"""  # a column for each field
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
        (version,) = source.execute("PRAGMA user_version").fetchone()
        _require_parts(source, version)
        _copy(source, target, version)


def _copy(source: sqlite3.Connection, target: sqlite3.Connection, version: int) -> None:
    given = _counters(source, version)
    counters = given.emptied()  # the ids that were given are used up
    counters.forgotten = given.forgotten if version > 5 else 0
    bear(target)
    with target as transaction:
        for table in OLD_TABLES:
            for row in _rows(source, table, version):
                for name, written in _renewed_rows(table, row, version):
                    insert(transaction, name, written)
                counters.enter(table, row["id"])
                counters.landmark = max(counters.landmark, row.get("landmark", 0))
        for table in BESIDE if version == 7 else ():
            for row in _rows(source, table, version):
                insert(transaction, table, sealed(table, row))
        for what in MOST_IDS:
            counters.next(what)
        counters.write(transaction)


def _counters(source: sqlite3.Connection, version: int) -> Counters:
    """The counters of an older version. ValueError where they are damaged or do not agree with what there is."""
    if version == 7:
        row = counters_row(source, "counters")
        require_sealed("the counters", "counters", row)
        return _counted(source, row)
    row = counters_row(source, "books")
    require_same("the counters", row["seal"], checksum_of("books", row, "seal"))
    counters = _counted(source, row)
    for table in OLD_TABLES:
        (found,) = source.execute(f"SELECT COALESCE(SUM(seal), 0) FROM {table}").fetchone()
        require_same(f"the {table}s", row[f"{table}_seals"], found)
    return counters


def _counted(source: sqlite3.Connection, row: Mapping[str, Any]) -> Counters:
    """The counters of a row that may have no vetoes. ValueError where they do not agree with what there is."""
    counters = Counters(**{field.name: row[field.name] for field in fields(Counters) if field.name in row})
    counters.require_rows(source, OLD_TABLES)
    return counters


def _renewed_rows(table: str, row: dict[str, Any], version: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """The rows of this version, each with its table, that say what one of an older version does."""
    if table == "closure" or version == 7:
        yield table, _closure(row) if version == 5 else sealed(table, row)
        return
    beside, names = MOVED[table]
    added = ROBOT if version == 5 and table == "keyframe" else {}
    yield table, sealed(table, {name: value for name, value in row.items() if name not in names} | added)
    yield beside, sealed(beside, {"id": row["id"]} | {new: _inflated(row[old]) for old, new in names.items()})


def _inflated(blob: bytes) -> bytes:
    """What an older version has in zlib's container; ValueError where that is none, or too large."""
    reader = zlib.decompressobj()
    try:
        said = reader.decompress(blob, MOST_BLOB)
    except zlib.error as error:
        raise ValueError(f"expected a packed blob, got {len(blob)} damaged bytes ({error})") from error
    if not reader.eof:
        raise ValueError(f"expected a packed blob of at most {MOST_BLOB} bytes, got more or a part of one")
    return said


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


def _rows(source: sqlite3.Connection, table: str, version: int) -> Iterator[dict[str, Any]]:
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
        yield _opened(table, row, version)


def _opened(table: str, row: dict[str, Any], version: int) -> dict[str, Any]:
    """A row without its checksums; ValueError where they are wrong."""
    what = f"{table} {row['id']}"
    if version == 7:
        require_sealed(what, table, row)
    elif table == "closure":
        require_same(what, row["seal"], checksum_of(table, row, "seal"))
    else:
        names = HEADS[version] if table == "keyframe" else LIGHT
        require_same(what, row["seal"], checksum(table, (row[name] for name in names)))
    if table == "keyframe" and version < 7:
        require_same(what, row["whole"], checksum_of(table, row, "whole"))
    if table == "object" and version < 7:
        require_same(f"the points of {what}", row["cloud_crc"], zlib.crc32(row["cloud"]))
    return {name: value for name, value in row.items() if name not in SEALS}


def _require_parts(source: sqlite3.Connection, version: int) -> None:
    """ValueError unless a database has the tables, columns and indices of the older version, and nothing else."""
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(SCHEMA + WITHOUT_VETOES if version == 7 else TABLES_6)
        if version == 5:
            dropped = "".join(f"ALTER TABLE keyframe DROP COLUMN {name};" for name in ROBOT)
            model.executescript(f"{dropped} DROP TABLE closure; {CLOSURES_5};")
        wanted, got = _parts(model), _parts(source)
    if wanted != got:
        first = sorted(wanted ^ got)[0]
        expected = f"expected the tables of a store of version {version}"
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
