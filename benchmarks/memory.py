# SPDX-License-Identifier: Apache-2.0
"""The registrar's memory over a long run through ever new places, as fast as it goes: does what is cold leave it?

Some simulated tables are passed in turn, each time at another place of a long corridor; one pass in four is at a place
of before, so that loops close and cold keyframes are read. Every minute of the stream: resident (RSS) and
proportional memory (PSS), what is stored, and what stays decoded and prepared. ``mb_per_hour`` is the slope of a line
(least squares) through the RSS after the first `SETTLED` of the run, when all that is bounded is full.

    python benchmarks/memory.py --json OUT [--hours 1] [--store FILE] [--quick]
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from command_line import quick_values
from sources import TRUE_BOXES, Reading, detector_of, read_source
from tables import table_plan
from tqdm import tqdm

from objreg_ros.bridge.process.lifetime import share_arenas
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.simulation.write import write_plan

FRAMES, EVERY = 120, 3  # of a pass at 30 Hz, and of them every so many-th: ten a second
OBJECTS = 8
APART_M, SPEED, STEP_NS = 8.0, 4.0, 500_000_000  # from place to place, m/s, and between two frames of a way
LATELY = 8  # one of so many last places is passed again: their keyframes are neither decoded nor prepared any more
DRIFT = 0.001  # of odometry, which is exact here: places that look alike differ by where they are
AGAIN = 4  # one pass of so many is at a place of before
MINUTE_NS = 60 * 10**9
SETTLED = 1 / 3
QUICK = {"hours": 0.05, "tables": 2}


def passes(tables: int, folder: Path) -> list[list[Frame]]:
    """The frames of a pass of each table."""
    found = []
    for seed in range(tables):
        path = folder / f"table_{seed}"
        write_plan(path, table_plan(OBJECTS, FRAMES, seed), "table", seed, jpeg=True, threads=os.cpu_count() or 1)
        with read_source(path, detector_of(TRUE_BOXES), seed, reading=Reading(every=EVERY)) as source:
            found.append(source.frames)
    return found


def stream(seen: list[list[Frame]], hours: float) -> Iterator[Frame]:
    """The passes one after the other, at new places and at some of before, and the ways between them."""
    draw, last, new, passed = np.random.default_rng(0), None, 0, 0
    while last is None or last.stamp_ns < 3600e9 * hours:
        again = new > LATELY and passed % AGAIN == 0
        place = new - 1 - int(draw.integers(LATELY)) if again else new
        passed, new = passed + 1, new + (not again)
        frames = seen[place % len(seen)]
        placed = [replace(frame, T_odom_camera=_moved(frame, APART_M * place), proven=True) for frame in frames]
        began_ns = 10**9
        if last is not None:
            yield from (way := list(_way(last, placed[0])))
            began_ns = way[-1].stamp_ns + STEP_NS
        for frame in placed:
            last = replace(frame, stamp_ns=began_ns + frame.stamp_ns - placed[0].stamp_ns)
            yield last


def _moved(frame: Frame, metres: float) -> Array:
    T_odom_camera = np.array(frame.T_odom_camera)
    T_odom_camera[0, 3] += metres
    return T_odom_camera


def _way(last: Frame, following: Frame) -> Iterator[Frame]:
    """Frames without objects from one pass to another, at `SPEED`: odometry goes on, and so does the session."""
    here, there = np.array(last.T_odom_camera), np.array(following.T_odom_camera)
    steps = int(np.linalg.norm(there[:3, 3] - here[:3, 3]) / (SPEED * 1e-9 * STEP_NS)) + 1
    for k in range(1, steps + 1):
        T_odom_camera = here.copy()
        T_odom_camera[:3, 3] += k / steps * (there[:3, 3] - here[:3, 3])
        yield replace(last, objects=(), stamp_ns=last.stamp_ns + k * STEP_NS, T_odom_camera=T_odom_camera)


def run(seen: list[list[Frame]], hours: float, params: RegistrarParams) -> list[dict[str, float]]:
    """One registrar through the whole stream; a row a minute of it."""
    rows: list[dict[str, float]] = []
    closures, began = 0, time.perf_counter()
    with closing(Registrar(params)) as registrar, tqdm(total=round(60 * hours)) as bar:
        for frame in stream(seen, hours):
            closures += len(registrar.process(frame).closures)
            if frame.stamp_ns >= MINUTE_NS * (len(rows) + 1):
                rows.append({"minute": len(rows) + 1, **memory_mb(), **held(registrar), "closures": closures})
                rows[-1]["seconds"] = round(time.perf_counter() - began, 1)
                bar.update()
                tqdm.write(line_of(rows[-1]))
    return rows


def memory_mb() -> dict[str, float]:
    """RSS and PSS of this process in MB."""
    lines = dict(line.split(":", 1) for line in Path("/proc/self/smaps_rollup").read_text().splitlines()[1:])
    return {f"{name.lower()}_mb": round(1.024e-3 * int(lines[name.title()].split()[0]), 1) for name in ("rss", "pss")}


def held(registrar: Registrar) -> dict[str, float]:
    """What is stored, and what of it is in memory beside the index."""
    counts = registrar.counts()
    recent, prepared = registrar._store._recent, registrar._method._cache  # type: ignore[attr-defined]
    return {
        **{name: counts[name] for name in ("keyframes", "objects", "landmarks")},
        "decoded_mb": round(recent.nbytes / 1e6, 1),
        "prepared_mb": round(prepared.nbytes / 1e6, 1),
    }


def mb_per_hour(rows: list[dict[str, float]]) -> float:
    """The slope of the RSS once all that is bounded is full."""
    late = rows[round(SETTLED * len(rows)) :]
    minutes, memory = [row["minute"] for row in late], [row["rss_mb"] for row in late]
    return 60.0 * float(np.polyfit(minutes, memory, 1)[0]) if len(late) > 1 else float("nan")


def line_of(row: dict[str, float]) -> str:
    """One minute."""
    return "  ".join(f"{name} {value:g}" for name, value in row.items())


@click.command(help=__doc__)
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--hours", default=1.0, show_default=True, help="Of the stream.")
@click.option("--tables", default=6, show_default=True, help="So many tables are simulated.")
@click.option("--store", help="The store's file, empty for none; a new one by default, gone afterwards.")
@click.option("--candidates", default=1, show_default=True, help="Tried for each keyframe; fewer are faster.")
@click.option("--quick", is_flag=True, help="Three minutes of two tables.")
@click.pass_context
def main(
    context: click.Context,
    out: Path | None,
    hours: float,
    tables: int,
    store: str | None,
    candidates: int,
    quick: bool,
) -> None:
    """Measure and print."""
    fewer = quick_values(context, quick, QUICK)
    hours, tables = fewer.get("hours", hours), fewer.get("tables", tables)
    share_arenas()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seen = passes(tables, folder)
        path = str(folder / "store.db") if store is None else store
        rows = run(seen, hours, RegistrarParams(store=path, candidates=candidates, odometry_drift=DRIFT))
    figures = {"mb_per_hour": round(mb_per_hour(rows), 2), "minutes": rows}
    click.echo(f"RSS {rows[-1]['rss_mb']:g} MB at the end, {figures['mb_per_hour']:g} MB an hour")
    if out is not None:
        out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
