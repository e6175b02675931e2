# SPDX-License-Identifier: Apache-2.0
"""The file of a store: how it is made, told from others, and brought to this version."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

MAGIC = b"SQLite format 3\0"
APPLICATION_ID = 0x4F424A52  # "OBJR" at byte 68 of the file
SCHEMA_VERSION = 4  # at byte 60
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
""",  # it was that of one view: see `plumb`
    3: """
CREATE TABLE highest (landmark INTEGER NOT NULL);
INSERT INTO highest SELECT COALESCE(MAX(landmark), 0) FROM object;
""",
}


class StoreError(OSError):
    """A file that is no store, is damaged or newer (it has not been touched), or that cannot be written."""


def is_store(path: str | Path) -> bool:
    """Whether the file at ``path`` bears the mark of a store, of any version and in any state."""
    if not Path(path).is_file():
        return False
    with Path(path).open("rb") as file:
        header = file.read(100)
    return header.startswith(MAGIC) and int.from_bytes(header[68:72], "big") == APPLICATION_ID


def require_place(path: Path, read_only: bool) -> None:
    """StoreError unless there is a file at ``path``, or one can be made and may be."""
    if path.is_file():
        return
    if read_only:
        raise StoreError(f"{path}: expected a store of objreg_ros, got no file")
    if path.exists() or not path.parent.is_dir():
        raise StoreError(f"{path}: expected a file in an existing folder, got none; make the folder, or use another")


def create(path: Path) -> None:
    """An empty store, made beside its place and moved there: a process that is killed here leaves no half of one."""
    beside = path.with_name(f"{path.name}.new{os.getpid()}")
    beside.unlink(missing_ok=True)
    with closing(sqlite3.connect(beside)) as connection:
        connection.executescript(birth())
    os.replace(beside, path)


def birth() -> str:
    """The statements that make a store of an empty database."""
    return f"PRAGMA application_id = {APPLICATION_ID}; PRAGMA user_version = {SCHEMA_VERSION}; {SCHEMA}"


def renew(connection: sqlite3.Connection) -> None:
    """Bring a store of an older version to this one, in one transaction for each version."""
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    for old in range(version, SCHEMA_VERSION):
        connection.executescript(f"BEGIN; {RENEWALS[old]} PRAGMA user_version = {old + 1}; COMMIT;")


def check(path: Path) -> None:
    """StoreError unless the file is a whole store of a version that is understood. It is only read."""
    with path.open("rb") as file:
        header = file.read(100)
    if len(header) < 100 or not header.startswith(MAGIC):
        raise StoreError(f"{path}: expected a store of objreg_ros, got a file of another kind; it was left as it is")
    if not is_store(path):
        raise StoreError(f"{path}: expected a store of objreg_ros, got another SQLite database; it was left as it is")
    _refuse_newer(path, int.from_bytes(header[60:64], "big"))
    version, found = _look_through(path)
    _refuse_newer(path, version)
    if found:
        raise StoreError(f"{path}: expected an intact store, got: {found}; it was left as it is. Use another path")


def _refuse_newer(path: Path, version: int) -> None:
    if version > SCHEMA_VERSION:
        raise StoreError(
            f"{path}: expected schema version {SCHEMA_VERSION} or older, got {version}; it was left as it is. "
            "Use the newer objreg_ros that wrote it, or another path"
        )


def read_only_uri(path: Path) -> str:
    """Without a log beside it the file is all there is, and no helper files are made to read it."""
    mode = "mode=ro" if path.with_name(path.name + "-wal").exists() else "mode=ro&immutable=1"
    return f"{path.resolve().as_uri()}?{mode}"


def _look_through(path: Path) -> tuple[int, str]:
    """The version of a database, and what is wrong with its pages, empty if nothing. Opens it for reading only.

    With what a log beside it says: the program that wrote it may have been killed before that came into the file.
    """
    try:
        with closing(sqlite3.connect(read_only_uri(path), uri=True)) as connection:
            version = int(connection.execute("PRAGMA user_version").fetchone()[0])
            found = str(connection.execute("PRAGMA quick_check(1)").fetchone()[0])
    except sqlite3.DatabaseError as error:
        return 0, str(error)
    return version, "" if found == "ok" else found
