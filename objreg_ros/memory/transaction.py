# SPDX-License-Identifier: Apache-2.0
"""The changes of a store's tables that are counted: rows written and deleted, landmarks renamed."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.checksum import sealed
from objreg_ros.memory.codec import closure_row, cloud_row, keyframe_row, object_row, require_object, scene_row
from objreg_ros.memory.counters import Counters
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.migration import insert
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.veto import MOST_VETOES, Veto, veto_row
from objreg_ros.registration.keyframe import Keyframe

OLDEST = "WHERE id IN (SELECT id FROM closure ORDER BY id LIMIT ?)"
SESSION = """SELECT COALESCE(MAX(MAX(COALESCE(from_session, -1), COALESCE(to_session, -1))), -1)
  FROM (SELECT from_session, to_session FROM closure UNION ALL SELECT from_session, to_session FROM veto)"""  # newest


def write(transaction: sqlite3.Connection, counters: Counters, table: str, row: Mapping[str, Any]) -> None:
    """Enter a row and count it."""
    insert(transaction, table, row)
    counters.enter(table, row["id"])


def write_keyframe(
    transaction: sqlite3.Connection, counters: Counters, keyframe: Keyframe, sightings: Sequence[Sighting]
) -> None:
    """Enter a keyframe and its objects."""
    write(transaction, counters, "keyframe", keyframe_row(keyframe))
    insert(transaction, "scene", scene_row(keyframe))
    for item, sighting in zip(keyframe.objects, sightings, strict=True):
        number = counters.next("object")
        write(transaction, counters, "object", object_row(number, item, sighting))
        insert(transaction, "cloud", cloud_row(number, item.cloud))
    counters.give_landmark(max((sighting.landmark for sighting in sightings), default=0))


def delete(
    transaction: sqlite3.Connection, counters: Counters, table: str, where: str = "", values: Sequence[Any] = ()
) -> None:
    """Delete the rows of a table that ``where`` names, all without it, and count that."""
    counters.change(table, -transaction.execute(f"DELETE FROM {table} {where}", values).rowcount)


def write_closures(
    transaction: sqlite3.Connection, counters: Counters, closures: Iterable[LoopClosure], most: int
) -> None:
    """Enter closures, and forget the oldest of more than ``most``."""
    for closure in closures:
        write(transaction, counters, "closure", closure_row(counters.next("closure"), closure))
    if counters.closure_rows > most:
        delete(transaction, counters, "closure", OLDEST, (counters.closure_rows - most,))


def write_veto(transaction: sqlite3.Connection, counters: Counters, closure_number: int | None, veto: Veto) -> None:
    """Enter a veto, and take the closure of that number out. ValueError where there are `MOST_VETOES`."""
    if counters.veto_rows >= MOST_VETOES:
        raise ValueError(f"expected at most {MOST_VETOES} vetoes, got one more")
    write(transaction, counters, "veto", veto_row(counters.next("veto"), veto))
    if closure_number is not None:
        delete(transaction, counters, "closure", "WHERE id = ?", (closure_number,))


def take_veto_back(
    transaction: sqlite3.Connection, counters: Counters, veto_number: int, veto: Veto, most: int
) -> None:
    """Delete the veto of that number, and enter its closure again if it was one of this store."""
    delete(transaction, counters, "veto", "WHERE id = ?", (veto_number,))
    write_closures(transaction, counters, (veto.closure,) if veto.was_stored else (), most)


def rename_landmarks(transaction: sqlite3.Connection, merged: Mapping[int, Merge]) -> None:
    """Make every sighting of the landmarks that are gone one of that which stays."""
    for old, merge in merged.items():
        _rename_landmark(transaction, old, merge)


def _rename_landmark(transaction: sqlite3.Connection, old: int, merge: Merge) -> None:
    """Make every sighting of a landmark one of that which stays, in its axes."""
    for row in transaction.execute("SELECT * FROM object WHERE landmark = ?", (old,)).fetchall():
        require_object(row)
        turned = merge.R_into_old @ np.frombuffer(row["R_landmark_session"]).reshape(3, 3)
        new = sealed("object", {**row, "landmark": int(merge.into), "R_landmark_session": turned.tobytes()})
        transaction.execute(
            "UPDATE object SET landmark = ?, R_landmark_session = ?, checksum = ? WHERE id = ?",
            (new["landmark"], new["R_landmark_session"], new["checksum"], row["id"]),
        )
