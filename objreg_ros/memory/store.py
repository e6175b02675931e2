# SPDX-License-Identifier: Apache-2.0
"""What the registrar remembers, in one SQLite file: keyframes, their objects and closures.

What `Store.write_keyframe` has returned from is on the disk: the file is in WAL mode with full synchronisation,
and a keyframe with its objects and closures is one transaction, so a process that is killed at any time leaves whole
keyframes. The log is folded into the file after each of them, so that nothing hangs on the log alone. What is read was
written: every row has a checksum of all its columns, and the `counters` say how many there are. Memory is bounded: only
the last keyframes that were used stay decoded, also where no file is named: a temporary one has the rest. So is the
file: free space goes back to the disk.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closure_id import Identity, identity_of
from objreg_ros.data.closures import LoopClosure
from objreg_ros.keyframes.recent import RecentKeyframes
from objreg_ros.memory.claim import Claim, StoreError
from objreg_ros.memory.codec import (
    closure_from_row,
    keyframe_from_rows,
    pose_from_row,
    require_keyframe,
    sighting_from_row,
)
from objreg_ros.memory.counters import Counters, read_counters
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.migration import opened
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store_file import (
    STEP,
    bytes_in_use,
    bytes_of,
    copy,
    create,
    dated_link,
    fold_log,
    require_place,
    shrink,
    temporary,
)
from objreg_ros.memory.transaction import (
    SESSION,
    delete,
    rename_landmarks,
    take_veto_back,
    write_closures,
    write_keyframe,
    write_veto,
)
from objreg_ros.memory.veto import Stand, Veto, closure_numbers, closures_at, numbers_among, veto_from_row
from objreg_ros.registration.keyframe import Keyframe

LEFT = "; it was left as it is. Use a copy of it or another path"
MOST_CLOSURES = 100_000  # of 1.5 kB; the oldest are forgotten
ROWS = (  # of one keyframe
    "SELECT * FROM keyframe WHERE id = ?",
    "SELECT * FROM scene WHERE id = ?",
    "SELECT * FROM object WHERE keyframe = ? ORDER BY id",
    "SELECT cloud.* FROM cloud JOIN object USING (id) WHERE keyframe = ? ORDER BY id",
)
FINGERPRINTS = "SELECT stamp_ns, travelled, turned, T_odom_camera, gravity, gravity_confidence FROM keyframe"
HEAD = ("id", "session", "stamp_ns", "robot", "origin", "travelled", "by_odometry")  # what is kept of each keyframe


class Store:
    """The store at ``path``, made if it is not there; a temporary one if that is empty. StoreError if it is bad.

    A store that is written is this one's alone until `close` (see `Claim`). With ``read_only`` nothing is made or
    changed, whoever writes it, and a path without a store is a StoreError too. Whatever the file refuses later (a full
    disk, a lock that another process holds) is a StoreError as well.
    """

    def __init__(self, path: str | Path = "", read_only: bool = False) -> None:
        self.path = str(Path(path).expanduser().resolve()) if str(path) else ""  # of a link what it leads to
        self._recent = RecentKeyframes()
        self._heads: dict[int, Mapping[str, Any]] = {}  # of the keyframes, the oldest first
        self._counters = Counters()
        self._claim: Claim | None = None
        if not self.path and not read_only:
            self._connection = temporary()
            return
        with self._reporting("open", LEFT), ExitStack() as undo:
            require_place(Path(self.path), read_only)
            if not read_only:
                self._claim = Claim(Path(self.path), create)
                undo.callback(self._claim.release)
            self._connection = opened(Path(self.path), self._claim)
            undo.callback(self._connection.close)
            self._counters = read_counters(self._connection)
            for row in self._connection.execute("SELECT * FROM keyframe ORDER BY id"):
                require_keyframe(row)
                self._heads[row["id"]] = {name: row[name] for name in HEAD}
            undo.pop_all()

    def write_keyframe(
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
        with self._reporting(f"write keyframe {keyframe.keyframe_id}"), self._changing() as (transaction, counters):
            write_keyframe(transaction, counters, keyframe, sightings)
            write_closures(transaction, counters, closures, MOST_CLOSURES)
            rename_landmarks(transaction, merged or {})
        self._heads[keyframe.keyframe_id] = {"id": keyframe.keyframe_id} | {n: getattr(keyframe, n) for n in HEAD[1:]}
        self._recent.keep(keyframe)

    def add_closure(self, closure: LoopClosure, merged: Mapping[int, Merge]) -> None:
        """Write a closure of keyframes that are stored already; ``merged`` and StoreError as in `write_keyframe`."""
        self.add_closures(((closure, merged),))

    def add_closures(self, closures: Iterable[tuple[LoopClosure, Mapping[int, Merge]]]) -> None:
        """`add_closure` of several, all in one transaction: all of them are written, or none."""
        with self._reporting("write a closure"), self._changing() as (transaction, counters):
            for closure, merged in closures:
                write_closures(transaction, counters, (closure,), MOST_CLOSURES)
                rename_landmarks(transaction, merged)

    def veto(self, vetoes: Sequence[Veto]) -> None:
        """Withdraw closures, all or none: each is a veto from now on, and no closure of this store any more.

        StoreError where that cannot be written.
        """
        numbers = self._numbers("closure", vetoes)
        with self._reporting("veto a closure"), self._changing() as (transaction, counters):
            for one in vetoes:
                write_veto(transaction, counters, numbers.get(identity_of(one.closure)), one)

    def undo_veto(self, vetoes: Sequence[Veto]) -> None:
        """Take vetoes back, all or none: what was a closure of this store is one again. KeyError for one that is none.

        StoreError where that cannot be written.
        """
        numbers = self._numbers("veto", vetoes)
        with self._reporting("undo a veto"), self._changing() as (transaction, counters):
            for one in vetoes:
                take_veto_back(transaction, counters, numbers[identity_of(one.closure)], one, MOST_CLOSURES)

    def vetoes(self) -> list[Veto]:
        """Every closure that is withdrawn, the oldest veto first."""
        with self._reporting("read the vetoes", LEFT):
            return list(map(veto_from_row, self._connection.execute("SELECT * FROM veto ORDER BY id")))

    def closure_numbers(self) -> Generator[tuple[Identity, int], None, None]:
        """What makes each stored closure another, and its number for `closures`, the newest first; not read whole."""
        with self._reporting("read the closures"):
            yield from closure_numbers(self._connection, "closure")

    def _numbers(self, table: str, vetoes: Sequence[Veto]) -> dict[Identity, int]:
        with self._reporting("read the closures"), closing(closure_numbers(self._connection, table)) as numbers:
            return numbers_among([identity_of(one.closure) for one in vetoes], numbers)

    def keyframe(self, keyframe_id: int) -> Keyframe:
        """A stored keyframe; KeyError if it is not there, StoreError if it is damaged."""
        if (recent := self._recent.get(keyframe_id)) is not None:
            return recent
        with self._reporting(f"read keyframe {keyframe_id}"):
            rows, *others = (self._connection.execute(query, (keyframe_id,)).fetchall() for query in ROWS)
            if not rows:
                raise KeyError(keyframe_id)
            keyframe = keyframe_from_rows(rows[0], *others)
        self._recent.keep(keyframe)
        return keyframe

    def sightings(self, keyframe_id: int | None = None, landmark: int | None = None) -> Iterator[Sighting]:
        """Every stored object without its points, or those of one keyframe or of one landmark, oldest first."""
        asked = {"keyframe": keyframe_id, "landmark": landmark}
        terms = [f"{column} = {int(number)}" for column, number in asked.items() if number is not None]
        only = f" WHERE {' AND '.join(terms)}" if terms else ""
        with self._reporting("read the objects", LEFT):
            for row in self._connection.execute(f"SELECT * FROM object{only} ORDER BY id"):
                if row["keyframe"] not in self._heads:
                    raise ValueError(f"object {row['id']}: expected a stored keyframe, got number {row['keyframe']}")
                yield sighting_from_row(row, self._heads[row["keyframe"]])

    def closures(self, numbers: Sequence[int] | None = None) -> Iterator[LoopClosure]:
        """Every stored closure, oldest first, or those of ``numbers``, in their order.

        Their objects have the ids that they had when they were stored.
        """
        with self._reporting("read the closures"):
            if numbers is None:
                yield from map(closure_from_row, self._connection.execute("SELECT * FROM closure ORDER BY id"))
            else:
                yield from closures_at(self._connection, numbers)

    def keyframe_ids(self) -> list[int]:
        """The ids of the stored keyframes, oldest first."""
        return list(self._heads)

    def keyframe_at(self, session: int | None, stamp_ns: int) -> int | None:
        """The id of the keyframe of a session at a stamp; None where there is none."""
        heads = self._heads.values()
        return next((h["id"] for h in heads if h["session"] == session and h["stamp_ns"] == stamp_ns), None)

    def keyframes_at(self, stamp_ns: int) -> list[int]:
        """The ids of the keyframes at a stamp, of whatever session, the oldest first."""
        return [head["id"] for head in self._heads.values() if head["stamp_ns"] == stamp_ns]

    def stand_at(self, session: int | None, stamp_ns: int) -> Stand | None:
        """Where the keyframe of a session at a stamp stood; None where there is none, or it is damaged."""
        number = self.keyframe_at(session, stamp_ns)
        with suppress(StoreError), self._reporting(f"read keyframe {number}"):
            for row in self._connection.execute("SELECT * FROM keyframe WHERE id = ?", (number,)):
                require_keyframe(row)
                T = pose_from_row(row)
                return Stand(np.eye(4) if T is None else T, row["travelled"])
        return None

    def heads(self) -> Iterator[Mapping[str, Any]]:
        """What is known of each keyframe without reading it, by the names of `HEAD`, the oldest first."""
        yield from self._heads.values()

    def poses(self) -> Iterator[tuple[int, Array | None]]:
        """The id and ``T_odom_camera (4, 4)`` of every keyframe, the oldest first; None where it has none."""
        with self._reporting("read the poses"):
            for row in self._connection.execute("SELECT id, T_odom_camera FROM keyframe ORDER BY id"):
                yield row["id"], pose_from_row(row)

    def fingerprints(self) -> set[tuple[Any, ...]]:
        """What every keyframe measured when and where, in full precision: two that are equal are one keyframe."""
        with self._reporting("read the keyframes"):
            return set(map(tuple, self._connection.execute(FINGERPRINTS)))

    def beyond(self, most: int, most_bytes: float = math.inf) -> list[int]:
        """The ids of the oldest keyframes, those that are more than ``most`` or make the store larger than that.

        The newest is never one of them.
        """
        with self._reporting("look at its size"):
            spare = bytes_in_use(self._connection) - most_bytes
            ids = list(self._heads)
            count = max(len(ids) - most, 0)
            spare -= sum(bytes_of(self._connection, number) for number in ids[:count]) if spare > 0 else 0
            while spare > 0 and count < len(ids) - 1:
                spare -= bytes_of(self._connection, ids[count])
                count += 1
            return ids[:count]

    def remove(self, keyframe_ids: Sequence[int], forgotten: int = 0) -> None:
        """Forget keyframes and their objects; their closures stay, up to `MOST_CLOSURES`.

        ``forgotten`` is how many of them go for no other reason than that there is a limit: they are counted. Of the
        space that is free then, the file gives back what is more than `SPARE`, `STEP` pages at a time.
        """
        with self._reporting("remove keyframes"), self._changing() as (transaction, counters):
            for keyframe_id in keyframe_ids:
                delete(transaction, counters, "object", "WHERE keyframe = ?", (keyframe_id,))
                delete(transaction, counters, "keyframe", "WHERE id = ?", (keyframe_id,))
            counters.forgotten += forgotten
        for keyframe_id in keyframe_ids:
            self._recent.drop(keyframe_id)
            self._heads.pop(keyframe_id, None)
        with self._reporting("give space back"):
            shrink(self._connection, STEP)

    def clear(self) -> str:
        """Forget everything but the ids that were given; where what was is now, empty where it is nowhere.

        A file is not emptied: it keeps all that it has under a dated name beside, and a new one takes its place.
        StoreError where that cannot be: then everything is as it was.
        """
        if self._claim is not None and (self._heads or self._counters.closure_rows or self._counters.veto_rows):
            return self._set_aside(self._claim)
        with self._reporting("forget everything"), self._changing() as (transaction, counters):
            for table in ("veto", "closure", "object", "keyframe"):
                delete(transaction, counters, table)
            counters.forgotten = 0
        self._begin(counters)
        return ""

    def _set_aside(self, claim: Claim) -> str:
        path, given = Path(self.path), self._counters.emptied()
        self.save()  # all is in the one file
        with self._reporting("set it aside"):
            self._connection.close()
            try:
                dated = dated_link(path)
                try:
                    claim.replace(lambda beside: create(beside, given))
                except BaseException:
                    dated.unlink()
                    raise
            finally:
                self._connection = opened(path, claim)
        self._begin(given)
        return str(dated)

    def _begin(self, counters: Counters) -> None:
        self._recent.clear()
        self._heads, self._counters = {}, counters

    @contextmanager
    def _changing(self) -> Iterator[tuple[sqlite3.Connection, Counters]]:
        """A transaction with the counters that it changes, which are written with it or stay as they were."""
        counters = replace(self._counters)
        with self._connection as transaction:
            yield transaction, counters
            counters.write(transaction)
        self._counters = counters

    def next_keyframe(self) -> int:
        """An id that no keyframe ever had here; StoreError where they are used up."""
        with self._reporting("number a keyframe"):
            return self._counters.next("keyframe")

    def next_landmark(self) -> int:
        """An id that no landmark ever had here, whatever was forgotten since; StoreError where they are used up."""
        with self._reporting("number a landmark"):
            return self._counters.next("landmark")

    def next_closure(self) -> int:
        """A number that no closure ever had here; StoreError where they are used up."""
        with self._reporting("number a closure"):
            return self._counters.next("closure")

    def next_session(self) -> int:
        """The number of a session that nothing is stored of yet, nor is a closure to it, as to a keyframe elsewhere."""
        with self._reporting("number a session"):
            (stored,) = self._connection.execute(SESSION).fetchone()
        return max([stored, *(head["session"] for head in self._heads.values())]) + 1

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
        """How much is stored; ``forgotten`` are keyframes that went as there were too many.

        ``vetoed`` are closures that a person withdrew; ``closures`` are the others.
        """
        with self._reporting("count"):
            landmarks = self._connection.execute("SELECT COUNT(DISTINCT landmark) FROM object").fetchone()[0]
        return {
            "keyframes": self._counters.keyframe_rows,
            "objects": self._counters.object_rows,
            "landmarks": landmarks,
            "sessions": len({head["session"] for head in self._heads.values()}),
            "closures": self._counters.closure_rows,
            "vetoed": self._counters.veto_rows,
            "forgotten": self._counters.forgotten,
        }

    def save(self, path: str | Path = "") -> str:
        """Fold the write-ahead log into the file, or write a whole copy to ``path``. Returns where it is.

        StoreError where that cannot be: a temporary store keeps no file, and a log that others read stays.
        """
        with self._reporting(f"copy it to {path}" if path else "save it"):
            if path:
                copy(self._connection, Path(path).expanduser())
                return str(path)
            if not self.path:
                raise ValueError("expected a store in a file, got a temporary one; start with a path for it")
            shrink(self._connection)
            fold_log(self._connection, Path(self.path).name)
            return self.path

    def close(self) -> None:
        """End it; everything that was added is already written."""
        try:
            self._connection.close()
        finally:
            if self._claim is not None:
                self._claim.release()

    @contextmanager
    def _reporting(self, what: str, advice: str = "") -> Iterator[None]:
        """Say of any error of the database or of what it holds which file it is and what could not be done."""
        try:
            yield
        except StoreError:
            raise
        except (sqlite3.Error, ValueError, OverflowError, OSError) as error:
            why = " ".join(str(error).split())
            raise StoreError(f"{self.path or 'temporary store'}: cannot {what}: {why}{advice}") from error
