# SPDX-License-Identifier: Apache-2.0
"""Small stores for the tests of what is reported of one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from registration.samples import box, keyframe, moved

from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.memory.landmarks import Landmarks
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.params import RegistrarParams

SECOND = 1_000_000_000
Shown = tuple[float, int, tuple[ObjectCloud, ...]]  # seconds, session, objects


def store_of(file: Path, shown: Sequence[Shown], closures: Sequence[LoopClosure] = ()) -> Path:
    """A store of keyframes that follow each other; the closures are written with the last of them."""
    store, landmarks = Store(file), Landmarks(RegistrarParams())
    for number, (seconds, session, objects) in enumerate(shown, start=1):
        taken = keyframe(number, seconds, objects, session, moved(0.0))
        named, merged = landmarks.assign(sightings_of(taken))
        store.write_keyframe(taken, named, closures if number == len(shown) else (), merged)
        landmarks.add_sightings(named, merged)
    store.close()
    return file


def cup_and_book(file: Path) -> Path:
    """Two sessions of a cup and a book, of two keyframes and one."""
    objects = (box("cup", (0, 0, 1)), box("book", (0.5, 0, 1), instance=2))
    return store_of(file, [(10.0, 0, objects), (20.0, 0, objects), (30.0, 1, objects)])


def closure_of_move(from_s: float, to_s: float, label: str = "cup", metres: float = 0.4) -> LoopClosure:
    """A closure of two moments at one place, which states that something went so far."""
    return LoopClosure(
        from_ns=round(from_s * SECOND),
        to_ns=round(to_s * SECOND),
        T_from_to=np.eye(4),
        covariance=np.eye(6) * 1e-4,
        labels=("book",),
        evidence={f"moved {label} [m]": metres, "moved": 1.0},
    )


def at(x: float) -> tuple[ObjectCloud, ...]:
    """A book that stays and a cup at ``x``."""
    return box("book", (-0.5, 0, 1), instance=2), box("cup", (x, 0, 1))


def tying(from_s: float, to_s: float, from_session: int, to_session: int, x: float) -> LoopClosure:
    """A closure of two sessions, with the camera at *to* so far along x of that at *from*."""
    return LoopClosure(
        from_ns=round(from_s * SECOND),
        to_ns=round(to_s * SECOND),
        T_from_to=moved(x),
        covariance=np.eye(6) * 1e-4,
        labels=("book",),
        from_session=from_session,
        to_session=to_session,
    )
