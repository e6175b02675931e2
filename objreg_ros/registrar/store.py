# SPDX-License-Identifier: Apache-2.0
"""What the registrar remembers, in one SQLite file: keyframes, their objects and closures.

What `Store.add` has returned from is on the disk: the file is in WAL mode with full synchronisation, and a keyframe
with its objects and closures is one transaction, so a process that is killed at any moment leaves whole keyframes.
Memory is bounded: only the last few keyframes that were used stay decoded.
"""

from __future__ import annotations

import json
import sqlite3
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data import LoopClosure
from objreg_ros.registrar.claim import Claim
from objreg_ros.registrar.codec import keyframe_from_rows, keyframe_row, object_row, sighting_from_row
from objreg_ros.registrar.keyframe import Keyframe
from objreg_ros.registrar.landmarks import Merge
from objreg_ros.registrar.sighting import Sighting
from objreg_ros.registrar.store_file import StoreError, birth, check, create, read_only_uri, renew, require_place

CACHED = 64  # decoded keyframes in memory, about 1 MB each
MOST_CLOSURES = 100_000  # of 1.5 kB; the oldest are forgotten
OLDEST_CLOSURES = "DELETE FROM closure WHERE id IN (SELECT id FROM closure ORDER BY id LIMIT ?)"
SIGHTINGS = (
    "SELECT object.keyframe, session, stamp_ns, instance, label, score, extent, descriptor, position,"
    " object.camera, travelled, by_odometry, landmark, R_landmark_session"
    " FROM object JOIN keyframe ON keyframe.id = object.keyframe"
)


class Store:
    """The store at ``path``, made if it is not there; in memory only if the path is empty. StoreError if it is bad.

    A store that is written is this one's alone until `close` (see `Claim`). With ``read_only`` nothing is made or
    changed, whoever writes it, and a path without a store is a StoreError too. Whatever the file refuses later (a full
    disk, a lock that another process holds) is a StoreError as well.
    """

    def __init__(self, path: str | Path = "", read_only: bool = False) -> None:
        self.path = str(Path(path).expanduser().resolve()) if str(path) else ""  # of a link what it leads to
        self._cache: OrderedDict[int, Keyframe] = OrderedDict()
        self._sessions: dict[int, int] = {}  # of the keyframes, the oldest first: to count them is to read the file
        self._closures = 0  # that are stored: to count them is to read them all
        self._claim: Claim | None = None
        if not self.path and not read_only:
            self._connection = _connect(":memory:")
            self._connection.executescript(birth())
            return
        with self._told("open"), ExitStack() as undo:
            require_place(Path(self.path), read_only)
            if not read_only:
                self._claim = Claim(Path(self.path))
                undo.callback(self._claim.release)
            self._connection = self._opened(Path(self.path), read_only)
            undo.callback(self._connection.close)
            self._sessions.update(self._connection.execute("SELECT id, session FROM keyframe ORDER BY id"))
            self._closures = self._one("SELECT COUNT(*) FROM closure")
            undo.pop_all()

    @staticmethod
    def _opened(path: Path, read_only: bool) -> sqlite3.Connection:
        if not path.is_file():
            create(path)
        check(path)
        connection = _connect(read_only_uri(path) if read_only else str(path))
        if read_only:
            connection.execute("BEGIN")  # all that is read is of one moment
        else:
            connection.execute("PRAGMA journal_mode = WAL")
            renew(connection)
        return connection

    def add(
        self,
        keyframe: Keyframe,
        sightings: Sequence[Sighting],
        closures: Iterable[LoopClosure] = (),
        merged: Mapping[int, Merge] | None = None,
    ) -> None:
        """Write a keyframe under its id (see `next_keyframe`), its objects and closures in one transaction.

        ``merged`` says which landmarks became which, and in whose axes: known objects that turned out to be the same.
        StoreError where it cannot be written: then nothing of it is.
        """
        with self._told(f"write keyframe {keyframe.keyframe_id}"), self._connection as transaction:
            _insert(transaction, "keyframe", keyframe_row(keyframe))
            for item, sighting in zip(keyframe.objects, sightings, strict=True):
                _insert(transaction, "object", object_row(item, sighting))
            newest = max((sighting.landmark for sighting in sightings), default=0)
            transaction.execute("UPDATE highest SET landmark = MAX(landmark, ?)", (newest,))
            stored = self._closures
            for closure in closures:
                _insert(transaction, "closure", _closure_row(closure))
                stored += 1
            if stored > MOST_CLOSURES:
                transaction.execute(OLDEST_CLOSURES, (stored - MOST_CLOSURES,))
            for old, merge in (merged or {}).items():
                _rename(transaction, old, merge)
        self._sessions[keyframe.keyframe_id] = keyframe.session
        self._closures = min(stored, MOST_CLOSURES)
        self._remember(keyframe)

    def keyframe(self, keyframe_id: int) -> Keyframe:
        """A stored keyframe; KeyError if it is not there, StoreError if it is damaged."""
        if keyframe_id in self._cache:
            self._cache.move_to_end(keyframe_id)
            return self._cache[keyframe_id]
        with self._told(f"read keyframe {keyframe_id}"):
            row = self._connection.execute("SELECT * FROM keyframe WHERE id = ?", (keyframe_id,)).fetchone()
            if row is None:
                raise KeyError(keyframe_id)
            objects = self._connection.execute("SELECT * FROM object WHERE keyframe = ? ORDER BY id", (keyframe_id,))
            keyframe = keyframe_from_rows(row, objects.fetchall())
        self._remember(keyframe)
        return keyframe

    def sightings(self, keyframe_id: int | None = None) -> Iterator[Sighting]:
        """Every stored object without its points, or those of one keyframe, oldest first."""
        only = "" if keyframe_id is None else f" WHERE object.keyframe = {int(keyframe_id)}"
        with self._told("read the objects", "; it was left as it is. Use a copy of it or another path"):
            yield from map(sighting_from_row, self._connection.execute(f"{SIGHTINGS}{only} ORDER BY object.id"))

    def closures(self) -> Iterator[LoopClosure]:
        """Every stored closure, oldest first, without the registrations of its objects."""
        with self._told("read the closures"):
            yield from map(_closure, self._connection.execute("SELECT * FROM closure ORDER BY id"))

    def keyframe_ids(self) -> list[int]:
        """The ids of the stored keyframes, oldest first."""
        return list(self._sessions)

    def beyond(self, most: int) -> list[int]:
        """The ids of the oldest keyframes, those that are more than ``most``."""
        return list(islice(self._sessions, max(len(self._sessions) - most, 0)))

    def remove(self, keyframe_ids: Sequence[int]) -> None:
        """Forget keyframes and their objects; their closures stay, up to `MOST_CLOSURES`."""
        with self._told("remove keyframes"), self._connection as transaction:
            transaction.executemany("DELETE FROM keyframe WHERE id = ?", [(k,) for k in keyframe_ids])
        for keyframe_id in keyframe_ids:
            self._cache.pop(keyframe_id, None)
            self._sessions.pop(keyframe_id, None)

    def clear(self) -> None:
        """Forget everything."""
        with self._told("forget everything"), self._connection as transaction:
            for table in ("closure", "object", "keyframe"):
                transaction.execute(f"DELETE FROM {table}")
        self._cache.clear()
        self._sessions.clear()
        self._closures = 0

    def next_keyframe(self) -> int:
        """An id that no keyframe ever had here."""
        return 1 + self._one("SELECT COALESCE(MAX(seq), 0) FROM sqlite_sequence WHERE name = 'keyframe'")

    def next_landmark(self) -> int:
        """An id that no landmark ever had here, whatever has been forgotten since."""
        return 1 + self._one("SELECT landmark FROM highest")

    def next_session(self) -> int:
        """The number of a session that nothing is stored of yet."""
        return max(self._sessions.values(), default=-1) + 1

    def last_session_beyond(self, session: int, stamp_ns: int) -> int:
        """The last of the sessions before ``session`` that has a keyframe of ``stamp_ns`` or later; -1 if none has."""
        wanted = "SELECT COALESCE(MAX(session), -1) FROM keyframe WHERE session < ? AND stamp_ns >= ?"
        with self._told("read the sessions"):
            return int(self._connection.execute(wanted, (session, stamp_ns)).fetchone()[0])

    def counts(self) -> dict[str, int]:
        """How many keyframes, objects, landmarks, sessions and closures there are."""
        return {
            "keyframes": len(self._sessions),
            "objects": self._one("SELECT COUNT(*) FROM object"),
            "landmarks": self._one("SELECT COUNT(DISTINCT landmark) FROM object"),
            "sessions": len(set(self._sessions.values())),
            "closures": self._closures,
        }

    def save(self, path: str | Path = "") -> str:
        """Fold the write-ahead log into the file, or write a whole copy to ``path``. Returns where it is.

        StoreError where that cannot be: a store in memory has no file, and a log that others read stays.
        """
        with self._told(f"copy it to {path}" if path else "save it"):
            if path:
                self._copy(Path(path).expanduser())
                return str(path)
            if not self.path:
                raise ValueError("expected a store in a file, got one in memory only; start with a path for it")
            busy, *_ = self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            if busy:
                name = Path(self.path).name
                raise ValueError(
                    f"expected nobody else to read it, got another program that does; all is written, but what is in "
                    f"{name}-wal is not in {name} yet: end that program and save again"
                )
            return self.path

    def _copy(self, path: Path) -> None:
        claim = Claim(path)
        try:
            with closing(sqlite3.connect(path)) as copy:
                self._connection.backup(copy)
        finally:
            claim.release()

    def close(self) -> None:
        """End it; everything that was added is already written."""
        try:
            self._connection.close()
        finally:
            if self._claim is not None:
                self._claim.release()

    def _one(self, query: str) -> int:
        with self._told("count"):
            return int(self._connection.execute(query).fetchone()[0])

    @contextmanager
    def _told(self, what: str, advice: str = "") -> Iterator[None]:
        """Say of any error of the database or of what it holds which file it is and what could not be done."""
        try:
            yield
        except (sqlite3.Error, ValueError) as error:
            raise StoreError(f"{self.path or 'memory'}: cannot {what}: {error}{advice}") from error

    def _remember(self, keyframe: Keyframe) -> None:
        self._cache[keyframe.keyframe_id] = keyframe
        while len(self._cache) > CACHED:
            self._cache.popitem(last=False)


def _connect(path: str) -> sqlite3.Connection:
    connection = sqlite3.connect(path, check_same_thread=False, timeout=5.0, uri=path.startswith("file:"))
    connection.row_factory = sqlite3.Row
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("PRAGMA synchronous = FULL")
    return connection


def _insert(transaction: sqlite3.Connection, table: str, row: Mapping[str, Any]) -> None:
    names, marks = ", ".join(row), ", ".join("?" * len(row))
    transaction.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))


def _rename(transaction: sqlite3.Connection, old: int, merge: Merge) -> None:
    """Make every sighting of a landmark one of that which stays, in its axes."""
    rows = transaction.execute("SELECT id, R_landmark_session FROM object WHERE landmark = ?", (old,)).fetchall()
    turned = [
        (merge.into, (merge.R_into_old @ np.frombuffer(row["R_landmark_session"]).reshape(3, 3)).tobytes(), row["id"])
        for row in rows
    ]
    transaction.executemany("UPDATE object SET landmark = ?, R_landmark_session = ? WHERE id = ?", turned)


def _closure_row(closure: LoopClosure) -> dict[str, Any]:
    return {
        "from_ns": closure.from_ns,
        "to_ns": closure.to_ns,
        "from_frame_id": closure.from_frame_id,
        "to_frame_id": closure.to_frame_id,
        "T_from_to": np.ascontiguousarray(closure.T_from_to).tobytes(),
        "covariance": np.ascontiguousarray(closure.covariance).tobytes(),
        "labels": json.dumps(closure.labels),
        "evidence": json.dumps(closure.evidence),
    }


def _closure(row: Mapping[str, Any]) -> LoopClosure:
    return LoopClosure(
        from_ns=row["from_ns"],
        to_ns=row["to_ns"],
        from_frame_id=row["from_frame_id" if "from_frame_id" in row.keys() else "frame_id"],  # noqa: SIM118
        to_frame_id=row["to_frame_id" if "to_frame_id" in row.keys() else "frame_id"],  # noqa: SIM118
        T_from_to=np.frombuffer(row["T_from_to"]).reshape(4, 4),
        covariance=np.frombuffer(row["covariance"]).reshape(6, 6),
        labels=tuple(json.loads(row["labels"])),
        evidence=json.loads(row["evidence"]),
    )
