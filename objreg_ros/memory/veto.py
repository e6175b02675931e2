# SPDX-License-Identifier: Apache-2.0
"""A closure that a person withdrew, with where its cameras stood: what it takes to know it again.

The row of a closure is found by what names it. To read a closure whole takes 0.2 ms, and there may be thousands.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closure_fields import closure_of, fields_of
from objreg_ros.data.closure_id import IDENTITY, Identity
from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.checksum import Row, require_sealed, sealed
from objreg_ros.memory.codec import closure_from_row, pose_of
from objreg_ros.registration.keyframe import Keyframe

MOST_VETOES = 10_000  # in a store: a person gives each
NAMED = ", ".join(f"json_extract(fields, '$.{name}')" for name in IDENTITY)
DEFAULTS = [next(field.default for field in fields(LoopClosure) if field.name == name) for name in IDENTITY]


class Stand(NamedTuple):
    """Where a keyframe was in its session: ``T_session_camera (4, 4)``, after ``travelled`` m of path."""

    T_session_camera: Array
    travelled: float

    @classmethod
    def of(cls, keyframe: Keyframe) -> Stand:
        """Of a keyframe."""
        T = keyframe.T_odom_camera
        return cls(np.eye(4) if T is None else T, keyframe.travelled)


Stands = tuple[Stand | None, Stand | None]  # of the cameras at *from* and at *to*, None where it is not known


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Veto:
    """A ``closure`` that is withdrawn, and where its cameras stood.

    ``was_stored`` says that it was a closure of this store, and is one again when the veto is undone; else another
    registrar found it.
    """

    closure: LoopClosure
    stands: Stands = (None, None)
    was_stored: bool = True


def veto_row(number: int, veto: Veto) -> Row:
    """The columns of a veto, under its number in the store."""
    row = {
        "id": int(number),
        "from_session": veto.closure.from_session,
        "to_session": veto.closure.to_session,
        "was_stored": int(veto.was_stored),
        "fields": json.dumps(fields_of(veto.closure)),
        "from_stand": _bytes(veto.stands[0]),
        "to_stand": _bytes(veto.stands[1]),
    }
    return sealed("veto", row)


def veto_from_row(row: Mapping[str, Any]) -> Veto:
    """A veto from its row. ValueError if it is damaged."""
    require_sealed(f"veto {row['id']}", "veto", row)
    try:
        return Veto(
            closure=closure_of(json.loads(row["fields"])),
            stands=(_stand(row["from_stand"]), _stand(row["to_stand"])),
            was_stored=bool(row["was_stored"]),
        )
    except (TypeError, ValueError, RecursionError, AttributeError) as error:
        raise ValueError(f"veto {row['id']}: expected a closure and two poses, got others ({error})") from error


def closure_numbers(connection: sqlite3.Connection, table: str) -> Generator[tuple[Identity, int], None, None]:
    """What makes each closure another, and its number, the newest first; of vetoes where that is the ``table``.

    No checksum is asked: who reads a closure whole by its number finds it damaged. sqlite3.Error where one is no JSON.
    """
    for number, *known in connection.execute(f"SELECT id, {NAMED} FROM {table} ORDER BY id DESC"):
        yield _identity(known), number


def numbers_among(names: Iterable[Identity], numbers: Iterable[tuple[Identity, int]]) -> dict[Identity, int]:
    """The newest number of each of ``names`` that has one. No more of ``numbers``, the newest first, is read."""
    lacking, found = set(names), dict[Identity, int]()
    for name, number in numbers if lacking else ():
        if name in lacking:
            lacking.remove(name)
            found[name] = number
            if not lacking:
                break
    return found


def _identity(known: Sequence[Any]) -> Identity:
    """The values of `IDENTITY`: a store of before may lack some."""
    if None in known:
        known = [default if one is None else one for one, default in zip(known, DEFAULTS, strict=True)]
    return tuple(known)


def closures_at(connection: sqlite3.Connection, numbers: Iterable[int]) -> Iterator[LoopClosure]:
    """The closures of these numbers. ValueError for one that is damaged, or not there."""
    for number in numbers:
        row = connection.execute("SELECT * FROM closure WHERE id = ?", (number,)).fetchone()
        if row is None:
            raise ValueError(f"expected a closure of the number {number}, got none")
        yield closure_from_row(row)


def stand_of(numbers: Array) -> Stand:
    """The stand of 17 numbers: a pose, row by row, and the path. ValueError if they are none."""
    if numbers.shape != (17,) or not np.isfinite(numbers).all():
        raise ValueError(f"stand: expected 17 finite numbers, got {numbers.shape}")
    return Stand(pose_of(numbers[:16]), float(numbers[16]))


def numbers_of(stand: Stand) -> Array:
    """The numbers (17,) of `stand_of`."""
    return np.append(np.asarray(stand.T_session_camera, float).ravel(), stand.travelled)


def _bytes(stand: Stand | None) -> bytes | None:
    return None if stand is None else numbers_of(stand).tobytes()


def _stand(blob: bytes | None) -> Stand | None:
    return None if blob is None else stand_of(np.frombuffer(blob))
