# SPDX-License-Identifier: Apache-2.0
"""What a frame costs the registrar, all in all, beside what is stored already.

A camera passes a table, and passes it again in another session, which closes loops with the first. Only the second pass
is timed: following every frame, and fusing, retrieving, registering, and storing the keyframes among them.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from sources import TRUE_BOXES, detector_of, read_source
from tables import table_plan

from objreg_ros.data.frames import Frame
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.simulation.write import write_plan

FRAMES = 180
OBJECTS = 8
ROUNDS = 5  # every store has its turn in each, so that a machine that changes its pace changes all


def table_frames(folder: Path) -> list[Frame]:
    """The frames of one pass."""
    path = folder / "table"
    write_plan(path, table_plan(OBJECTS, FRAMES, 0), "table", 0, jpeg=True, threads=os.cpu_count() or 1)
    with read_source(path, detector_of(TRUE_BOXES), 0) as source:
        return source.frames


def frame_costs(stores: Sequence[Path], frames: Sequence[Frame]) -> list[dict[str, float]]:
    """For each store the milliseconds a frame and, of them, a keyframe's search; medians of `ROUNDS`.

    The stores are changed: they hold the first pass afterwards.
    """
    for store in stores:
        _pass(store, frames)
    rounds: list[list[dict[str, float]]] = []
    for _ in range(ROUNDS):
        rounds.append([])
        for store in stores:
            copy = Path(shutil.copy(store, store.with_suffix(".copy")))
            rounds[-1].append(_pass(copy, frames))
            copy.unlink()
    names = rounds[0][0]
    return [{name: float(np.median([row[k][name] for row in rounds])) for name in names} for k in range(len(stores))]


def _pass(store: Path, frames: Sequence[Frame]) -> dict[str, float]:
    track = search = keyframes = closures = tries = 0.0
    with closing(Registrar(RegistrarParams(store=str(store)))) as registrar:
        for frame in frames:
            began = time.perf_counter()
            window = registrar.track(frame)
            tracked = time.perf_counter()
            outcome = registrar.search(window) if window is not None else None
            track, search = track + tracked - began, search + time.perf_counter() - tracked
            if outcome is not None:
                keyframes, closures = keyframes + 1, closures + len(outcome.closures)
                tries += len(outcome.closures) + len(outcome.rejected)
        registrar.save()
    return {
        "frame_ms": 1e3 * (track + search) / len(frames),
        "search_ms": 1e3 * search / max(keyframes, 1),
        "keyframes": keyframes,
        "closures": closures,
        "looked_at": tries,
    }
