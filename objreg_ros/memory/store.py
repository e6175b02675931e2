# SPDX-License-Identifier: Apache-2.0
"""What the registrar remembers, in one SQLite file: keyframes, their objects and closures.

What `Store.add` has returned from is on the disk: the file is in WAL mode with full synchronisation, and a keyframe
with its objects and closures is one transaction, so a process that is killed at any moment leaves whole keyframes.
The log is folded into the file after each of them, so that nothing hangs on the log alone. What is read was written:
every row has a checksum of all that it says (`seal`), and the `books` say how many there are. Memory is bounded: only
the last few keyframes that were used stay decoded. So is the file: room that is left free goes back to the disk.
"""

from __future__ import annotations

import sqlite3
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from objreg_ros.data import LoopClosure
from objreg_ros.memory.books import Books, read_books
from objreg_ros.memory.checksum import HEAD, require_head
from objreg_ros.memory.claim import Claim, StoreError
from objreg_ros.memory.codec import (
    closure_from_row,
    keyframe_from_rows,
    keyframe_row,
    object_row,
    sighting_from_row,
)
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.migration import renew, renewed
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store_file import (
    SCHEMA_VERSION,
    bear,
    check,
    connect,
    create,
    dated_link,
    read_only_uri,
    require_place,
)
from objreg_ros.memory.transaction import OBJECTS, SESSION, delete, rename_landmarks, write, write_closures
from objreg_ros.registration.keyframe import Keyframe

LEFT = "; it was left as it is. Use a copy of it or another path"
CACHED = 64  # decoded keyframes in memory, about 1 MB each
MOST_CLOSURES = 100_000  # of 1.5 kB; the oldest are forgotten
HEADS = f"SELECT {', '.join(HEAD)}, seal FROM keyframe ORDER BY id"
SPARE = 2048  # pages of 4 kB that may lie free in the file: what comes next takes them
STEP = 4096  # pages that are given back at once: 16 MB, so that no keyframe waits long


class Store:
    """The store at ``path``, made if it is not there; in memory only if the path is empty. StoreError if it is bad.

    A store that is written is this one's alone until `close` (see `Claim`). With ``read_only`` nothing is made or
    changed, whoever writes it, and a path without a store is a StoreError too. Whatever the file refuses later (a full
    disk, a lock that another process holds) is a StoreError as well.
    """

    def __init__(self, path: str | Path = "", read_only: bool = False) -> None:
        self.path = str(Path(path).expanduser().resolve()) if str(path) else ""  # of a link what it leads to
        self._cache: OrderedDict[int, Keyframe] = OrderedDict()
        self._heads: dict[int, Mapping[str, Any]] = {}  # of the keyframes, the oldest first
        self._books = Books()
        self._claim: Claim | None = None
        if not self.path and not read_only:
            self._connection = connect(":memory:")
            bear(self._connection)
            return
        with self._told("open", LEFT), ExitStack() as undo:
            require_place(Path(self.path), read_only)
            if not read_only:
                self._claim = Claim(Path(self.path), create)
                undo.callback(self._claim.release)
            self._connection = self._opened(Path(self.path), self._claim)
            undo.callback(self._connection.close)
            self._books = read_books(self._connection)
            for head in self._connection.execute(HEADS):
                require_head(head)
                self._heads[head["id"]] = head
            undo.pop_all()

    @staticmethod
    def _opened(path: Path, claim: Claim | None) -> sqlite3.Connection:
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
        with self._told(f"write keyframe {keyframe.keyframe_id}"), self._changing() as (transaction, books):
            row = keyframe_row(keyframe)
            write(transaction, books, "keyframe", row)
            for item, sighting in zip(keyframe.objects, sightings, strict=True):
                write(transaction, books, "object", object_row(books.next("object"), item, sighting))
            newest = max((sighting.landmark for sighting in sightings), default=0)
            books.landmark = max(books.landmark, newest)
            write_closures(transaction, books, closures, MOST_CLOSURES)
            rename_landmarks(transaction, books, merged or {})
        self._heads[keyframe.keyframe_id] = {name: row[name] for name in HEAD}
        self._remember(keyframe)

    def add_closure(self, closure: LoopClosure, merged: Mapping[int, Merge]) -> None:
        """Write a closure of keyframes that are stored already; ``merged`` and StoreError as in `add`."""
        with self._told("write a closure"), self._changing() as (transaction, books):
            write_closures(transaction, books, (closure,), MOST_CLOSURES)
            rename_landmarks(transaction, books, merged)

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
        only = "" if keyframe_id is None else f" WHERE keyframe = {int(keyframe_id)}"
        with self._told("read the objects", LEFT):
            for row in self._connection.execute(f"{OBJECTS}{only} ORDER BY id"):
                if row["keyframe"] not in self._heads:
                    raise ValueError(f"object {row['id']}: expected a stored keyframe, got number {row['keyframe']}")
                yield sighting_from_row(row, self._heads[row["keyframe"]])

    def closures(self) -> Iterator[LoopClosure]:
        """Every stored closure, oldest first, without the registrations of its objects."""
        with self._told("read the closures"):
            yield from map(closure_from_row, self._connection.execute("SELECT * FROM closure ORDER BY id"))

    def keyframe_ids(self) -> list[int]:
        """The ids of the stored keyframes, oldest first."""
        return list(self._heads)

    def beyond(self, most: int) -> list[int]:
        """The ids of the oldest keyframes, those that are more than ``most``."""
        return list(islice(self._heads, max(len(self._heads) - most, 0)))

    def remove(self, keyframe_ids: Sequence[int], forgotten: int = 0) -> None:
        """Forget keyframes and their objects; their closures stay, up to `MOST_CLOSURES`.

        ``forgotten`` is how many of them go for no other reason than that there is a limit: they are counted. Of the
        room that is free then, the file gives back what is more than `SPARE`, `STEP` pages at a time.
        """
        with self._told("remove keyframes"), self._changing() as (transaction, books):
            for keyframe_id in keyframe_ids:
                delete(transaction, books, "object", "WHERE keyframe = ?", (keyframe_id,))
                delete(transaction, books, "keyframe", "WHERE id = ?", (keyframe_id,))
            books.forgotten += forgotten
        for keyframe_id in keyframe_ids:
            self._cache.pop(keyframe_id, None), self._heads.pop(keyframe_id, None)
        self._shrink(STEP)

    def clear(self) -> str:
        """Forget everything but the ids that were given; where what was is now, empty where it is nowhere.

        A file is not emptied: it keeps all that it has under a dated name beside, and a new one takes its place.
        StoreError where that cannot be: then everything is as it was.
        """
        if self._claim is not None and (self._heads or self._books.closure_rows):
            return self._set_aside(self._claim)
        with self._told("forget everything"), self._changing() as (transaction, books):
            for table in ("closure", "object", "keyframe"):
                delete(transaction, books, table)
            books.forgotten = 0
        self._cache, self._heads = OrderedDict(), {}
        return ""

    def _set_aside(self, claim: Claim) -> str:
        path, given = Path(self.path), self._books.emptied()
        self.save()  # all is in the one file
        with self._told("set it aside"):
            self._connection.close()
            try:
                dated = dated_link(path)
                try:
                    claim.replace(lambda beside: create(beside, given))
                except BaseException:
                    dated.unlink()
                    raise
            finally:
                self._connection = self._opened(path, claim)
        self._cache, self._heads, self._books = OrderedDict(), {}, given
        return str(dated)

    def _shrink(self, most: int = 0) -> None:
        """Give room that lies free in the file back to the disk: all beyond `SPARE`, or ``most`` pages of it."""
        with self._told("give room back"):
            spare = self._connection.execute("PRAGMA freelist_count").fetchone()[0] - SPARE
            if spare > 0:
                pages = min(spare, most) if most else spare
                self._connection.executescript(f"PRAGMA incremental_vacuum({pages})")  # to its end

    @contextmanager
    def _changing(self) -> Iterator[tuple[sqlite3.Connection, Books]]:
        """A transaction with the books that it changes, which are written with it or stay as they were."""
        books = replace(self._books)
        with self._connection as transaction:
            yield transaction, books
            books.write(transaction)
        self._books = books

    def next_keyframe(self) -> int:
        """An id that no keyframe ever had here; StoreError where they are used up."""
        with self._told("number a keyframe"):
            return self._books.next("keyframe")

    def next_landmark(self) -> int:
        """An id that no landmark ever had here, whatever was forgotten since; StoreError where they are used up."""
        with self._told("number a landmark"):
            return self._books.next("landmark")

    def next_session(self) -> int:
        """The number of a session that nothing is stored of yet, nor is a closure to it, as to a keyframe elsewhere."""
        with self._told("number a session"):
            (told,) = self._connection.execute(SESSION).fetchone()
        return max([told, *(head["session"] for head in self._heads.values())]) + 1

    def sessions_beyond(self, robot: str, session: int, stamp_ns: int) -> frozenset[int]:
        """A robot's sessions before ``session``, up to the last that has a keyframe of ``stamp_ns`` or later."""
        own = [h for h in self._heads.values() if h["robot"] == robot and h["session"] < session]
        last = max((head["session"] for head in own if head["stamp_ns"] >= stamp_ns), default=-1)
        return frozenset(head["session"] for head in own if head["session"] <= last)

    def origins(self) -> dict[str, tuple[int, int]]:
        """By origin the session of keyframes from elsewhere, and the newest stamp in it."""
        heads = sorted((h for h in self._heads.values() if h["origin"]), key=lambda head: head["stamp_ns"])
        return {head["origin"]: (head["session"], head["stamp_ns"]) for head in heads}

    def counts(self) -> dict[str, int]:
        """How much is stored; ``forgotten`` are keyframes that went as there were too many."""
        with self._told("count"):
            landmarks = self._connection.execute("SELECT COUNT(DISTINCT landmark) FROM object").fetchone()[0]
        return {
            "keyframes": self._books.keyframe_rows,
            "objects": self._books.object_rows,
            "landmarks": landmarks,
            "sessions": len({head["session"] for head in self._heads.values()}),
            "closures": self._books.closure_rows,
            "forgotten": self._books.forgotten,
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
            self._shrink()
            busy, *_ = self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            if busy:
                name = Path(self.path).name
                raise ValueError(
                    f"expected nobody else to read it, got another program that does; all is written, but what is in "
                    f"{name}-wal is not in {name} yet: end that program and save again"
                )
            return self.path

    def _copy(self, path: Path) -> None:
        """Write a whole copy in the place of what is there, if it is nobody's."""

        def make(beside: Path) -> None:
            with closing(sqlite3.connect(beside)) as copy:
                self._connection.backup(copy)

        there = path.exists()
        claim = Claim(path, make)
        try:
            if there:
                claim.replace(make)
        finally:
            claim.release()

    def close(self) -> None:
        """End it; everything that was added is already written."""
        try:
            self._connection.close()
        finally:
            if self._claim is not None:
                self._claim.release()

    @contextmanager
    def _told(self, what: str, advice: str = "") -> Iterator[None]:
        """Say of any error of the database or of what it holds which file it is and what could not be done."""
        try:
            yield
        except StoreError:
            raise
        except (sqlite3.Error, ValueError, OverflowError, OSError) as error:
            why = " ".join(str(error).split())
            raise StoreError(f"{self.path or 'memory'}: cannot {what}: {why}{advice}") from error

    def _remember(self, keyframe: Keyframe) -> None:
        self._cache[keyframe.keyframe_id] = keyframe
        while len(self._cache) > CACHED:
            self._cache.popitem(last=False)
