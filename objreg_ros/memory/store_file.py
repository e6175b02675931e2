# SPDX-License-Identifier: Apache-2.0
"""The file of a store: how it is made, and how it is recognised."""

from __future__ import annotations

import os
import shutil
import sqlite3
import time
from contextlib import closing
from pathlib import Path

from objreg_ros.memory.claim import MAGIC, Claim, StoreError, read_header
from objreg_ros.memory.counters import Counters
from objreg_ros.whole_file import whole_file

APPLICATION_ID = 0x4F424A52  # "OBJR" at byte 68 of the file
SCHEMA_VERSION = 8  # at byte 60
OLDEST_VERSION = 5  # that of the first release
SPARE = 2048  # pages of 4 kB that may lie free in the file: what comes next takes them
CACHE_KB = 4096  # of the pages of a temporary store: some keyframes; a store of a few objects is never written
STEP = 4096  # pages that are given back at once: 16 MB, so that no keyframe waits long
PAGES = "page_count", "freelist_count", "page_size"
BYTES = """SELECT (SELECT LENGTH(view) + LENGTH(context) FROM scene WHERE id = ?)
  + COALESCE((SELECT SUM(LENGTH(points)) FROM cloud JOIN object USING (id) WHERE keyframe = ?), 0)"""
MOST_AGAIN = 1000  # files that one second may be the date of
SCHEMA = """
CREATE TABLE keyframe (
  id INTEGER PRIMARY KEY, robot TEXT NOT NULL, origin TEXT NOT NULL, session INTEGER NOT NULL,
  stamp_ns INTEGER NOT NULL, frame_id TEXT NOT NULL,
  travelled REAL NOT NULL, turned REAL NOT NULL, T_odom_camera BLOB, by_odometry INTEGER NOT NULL,
  gravity BLOB, gravity_confidence REAL NOT NULL,
  camera TEXT NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE scene (
  id INTEGER PRIMARY KEY REFERENCES keyframe ON DELETE CASCADE, view BLOB NOT NULL, context BLOB NOT NULL,
  checksum INTEGER NOT NULL);
CREATE TABLE object (
  id INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL REFERENCES keyframe ON DELETE CASCADE,
  instance INTEGER NOT NULL, landmark INTEGER NOT NULL, label TEXT NOT NULL, score REAL NOT NULL,
  extent REAL NOT NULL, sightings INTEGER NOT NULL, density REAL NOT NULL, position BLOB NOT NULL, camera BLOB NOT NULL,
  R_landmark_session BLOB NOT NULL, descriptor BLOB NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE cloud (
  id INTEGER PRIMARY KEY REFERENCES object ON DELETE CASCADE, points BLOB NOT NULL, checksum INTEGER NOT NULL);
CREATE INDEX object_of_keyframe ON object (keyframe);
CREATE INDEX object_of_landmark ON object (landmark);
CREATE TABLE closure (
  id INTEGER PRIMARY KEY, from_session INTEGER, to_session INTEGER, fields TEXT NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE veto (
  id INTEGER PRIMARY KEY, from_session INTEGER, to_session INTEGER, was_stored INTEGER NOT NULL, fields TEXT NOT NULL,
  from_stand BLOB, to_stand BLOB, checksum INTEGER NOT NULL);
CREATE TABLE counters (
  id INTEGER PRIMARY KEY, keyframe INTEGER NOT NULL, object INTEGER NOT NULL, closure INTEGER NOT NULL,
  veto INTEGER NOT NULL, landmark INTEGER NOT NULL, keyframe_rows INTEGER NOT NULL, object_rows INTEGER NOT NULL,
  closure_rows INTEGER NOT NULL, veto_rows INTEGER NOT NULL, forgotten INTEGER NOT NULL, checksum INTEGER NOT NULL);
"""


def is_store(path: str | Path) -> bool:
    """Whether the file at ``path`` bears the mark of a store, of any version and in any state."""
    if not Path(path).is_file():
        return False
    header = read_header(Path(path))
    return header.startswith(MAGIC) and int.from_bytes(header[68:72], "big") == APPLICATION_ID


def require_place(path: Path, read_only: bool) -> None:
    """StoreError unless there is a file at ``path``, or one can be made and may be."""
    if path.is_file():
        return
    if read_only:
        raise StoreError(f"{path}: expected a store of objreg_ros, got no file")
    if path.exists() or not path.parent.is_dir():
        raise StoreError(f"{path}: expected a file in an existing folder, got none; make the folder, or use another")


def create(path: Path, counters: Counters | None = None) -> None:
    """An empty store in an empty file, with the ids that ``counters`` say were given."""
    with closing(sqlite3.connect(path)) as connection:
        bear(connection, counters)


def bear(connection: sqlite3.Connection, counters: Counters | None = None) -> None:
    """Make a store of an empty database."""
    connection.executescript(
        f"PRAGMA auto_vacuum = INCREMENTAL; PRAGMA application_id = {APPLICATION_ID};"
        f"BEGIN; PRAGMA user_version = {SCHEMA_VERSION}; {SCHEMA} COMMIT;"
    )
    with connection as transaction:
        (counters or Counters()).write(transaction)


def shrink(connection: sqlite3.Connection, most: int = 0) -> None:
    """Give free space in the file back to the disk: all beyond `SPARE`, or ``most`` pages of it."""
    spare = connection.execute("PRAGMA freelist_count").fetchone()[0] - SPARE
    if spare > 0:
        pages = min(spare, most) if most else spare
        connection.executescript(f"PRAGMA incremental_vacuum({pages})")  # to its end


def fold_log(connection: sqlite3.Connection, name: str) -> None:
    """Fold the write-ahead log into the file of that name; ValueError where another program reads it."""
    busy, *_ = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    if busy:
        raise ValueError(
            f"expected nobody else to read it, got another program that does; all is written, but what is in "
            f"{name}-wal is not in {name} yet: end that program and save again"
        )


def bytes_in_use(connection: sqlite3.Connection) -> int:
    """What the pages take that are not free."""
    pages, free, size = (connection.execute(f"PRAGMA {what}").fetchone()[0] for what in PAGES)
    return int((pages - free) * size)


def bytes_of(connection: sqlite3.Connection, keyframe_id: int) -> int:
    """About what a keyframe and its objects take."""
    return int(connection.execute(BYTES, (keyframe_id, keyframe_id)).fetchone()[0])


def copy(connection: sqlite3.Connection, path: Path) -> None:
    """Write a whole copy of an open store in the place of what is at ``path``, if it is nobody's."""

    def make(beside: Path) -> None:
        with closing(sqlite3.connect(beside)) as into:
            connection.backup(into)

    there = path.exists()
    claim = Claim(path, make)
    try:
        if there:
            claim.replace(make)
    finally:
        claim.release()


def dated_link(path: Path) -> Path:
    """A second name of a file, ``place-20261127-101500.db`` by the clock here; OSError if it cannot have one.

    Where the file system knows one name only for a file, it is a copy.
    """
    for again in range(MOST_AGAIN):
        dated = path.with_stem(f"{path.stem}-{time.strftime('%Y%m%d-%H%M%S')}{f'-{again}' if again else ''}")
        if os.path.lexists(dated):
            continue
        try:
            os.link(path, dated)
        except OSError:
            with whole_file(dated) as into, path.open("rb") as source:
                shutil.copyfileobj(source, into)
        return dated
    raise FileExistsError(f"{dated}: expected a free name, got {MOST_AGAIN} that are taken")


def check(path: Path) -> int:
    """The version of a store; StoreError unless the file is whole and of a version that is known. It is only read."""
    header = read_header(path)
    if len(header) < 100 or not header.startswith(MAGIC):
        raise StoreError(f"{path}: expected a store of objreg_ros, got a file of another kind; it was left as it is")
    if not is_store(path):
        raise StoreError(f"{path}: expected a store of objreg_ros, got another SQLite database; it was left as it is")
    _refuse_version(path, int.from_bytes(header[60:64], "big"))
    version, found = _look_through(path)
    if not found or version:  # what could be read of it says more than the header
        _refuse_version(path, version)
    if found:
        raise StoreError(f"{path}: expected an intact store, got: {found}; it was left as it is. Use another path")
    return version


def _refuse_version(path: Path, version: int) -> None:
    if version > SCHEMA_VERSION:
        raise StoreError(
            f"{path}: expected schema version {SCHEMA_VERSION} or older, got {version}; it was left as it is. "
            "Use the newer objreg_ros that wrote it, or another path"
        )
    if version < OLDEST_VERSION:
        advice = "Open it with objreg_ros 0.2.0 first, or use" if version > 0 else "Use"
        raise StoreError(
            f"{path}: expected schema version {OLDEST_VERSION} to {SCHEMA_VERSION}, got {version}; "
            f"it was left as it is. {advice} another path"
        )


def read_only_uri(path: Path) -> str:
    """Without a log beside it the file is all there is, and no helper files are made to read it."""
    mode = "mode=ro" if path.with_name(path.name + "-wal").exists() else "mode=ro&immutable=1"
    return f"{path.resolve().as_uri()}?{mode}"


def _look_through(path: Path) -> tuple[int, str]:
    """The version of a database, 0 where it cannot be read, and what is wrong with it, empty if nothing.

    With what a log beside it says: the program that wrote it may have been killed before that came into the file. It is
    opened for reading only.
    """
    try:
        with closing(sqlite3.connect(read_only_uri(path), uri=True)) as connection:
            version = int(connection.execute("PRAGMA user_version").fetchone()[0])
            found = str(connection.execute("PRAGMA integrity_check(1)").fetchone()[0])
            if found == "ok" and version == SCHEMA_VERSION:
                found = _foreign(connection)
    except sqlite3.DatabaseError as error:
        return 0, " ".join(str(error).split())
    return version, "" if found == "ok" else " ".join(found.split())


def _foreign(connection: sqlite3.Connection) -> str:
    """What is in a database of this version that `bear` does not make, or the other way round; "ok" if nothing is."""
    with closing(sqlite3.connect(":memory:")) as model:
        bear(model)
        wanted, got = _parts(model), _parts(connection)
    for kind, name, *_ in sorted(wanted ^ got, key=str):
        whose = "one that no store has" if not any(part[:2] == (kind, name) for part in wanted) else "another or none"
        return f"the {kind} {name}: {whose}"
    return "ok"


def _parts(connection: sqlite3.Connection) -> set[tuple[object, ...]]:
    return {tuple(row) for row in connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master")}


def temporary() -> sqlite3.Connection:
    """An empty store that is gone when it is closed, and when the process is killed.

    SQLite keeps `CACHE_KB` of it in memory and the rest in a file without a name, in the first folder of SQLITE_TMPDIR,
    TMPDIR, /var/tmp and /tmp that can be written. An hour of new places is gigabytes: no robot has so much memory.
    """
    connection = connect("")
    connection.execute("PRAGMA temp_store = FILE")
    connection.execute(f"PRAGMA cache_size = -{CACHE_KB}")
    connection.execute("PRAGMA journal_mode = MEMORY")  # what a failed keyframe changed is undone from there
    bear(connection)
    return connection


def connect(path: str) -> sqlite3.Connection:
    """Open a file, or what SQLite makes of an empty path or ``:memory:``, with whole writes and rows by name."""
    connection = sqlite3.connect(path, check_same_thread=False, timeout=5.0, uri=path.startswith("file:"))
    connection.row_factory = sqlite3.Row
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("PRAGMA synchronous = FULL")
    return connection
