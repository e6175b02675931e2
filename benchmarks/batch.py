# SPDX-License-Identifier: Apache-2.0
"""How much faster more workers are, whether they find the same, and what the death of one costs.

    python benchmarks/batch.py runs/loop_* --json OUT
    python benchmarks/batch.py --simulate 24 --workers 1,2,4

Every run begins with warm code on disk. The last one has the last count of workers again, and one of its
processes is killed midway: the time that it takes longer shows in the median time of one recording.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import click
import pyarrow.parquet

from objreg_tools.cli.commands.simulate import camera_of, sensors_of
from objreg_tools.cli.many.batch_work import BatchWork
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import read_settings
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.batch.batch_tables import batch_tables
from objreg_tools.simulation.write import simulate
from objreg_tools.workers import Done, spread

HEAD = f"{'workers':16} {'s':>8} {'times':>6} {'recording, s':>13} {'constraints':>12}  same"
TABLES = ("constraints", "refusals")


def measure(
    recordings: Sequence[Path], workers: int, folder: Path, receive: Callable[[int], None] = lambda ended: None
) -> dict[str, Any]:
    """The figures of one run over all recordings; ``receive`` gets how many have ended."""
    settings = read_settings(None, ["registrar.threads=1", "detector.threads=1"])
    work = BatchWork.of(RecordedOptions(settings), folder, ("batch",))
    start, ended = time.perf_counter(), list[Done[Path, str]]()
    for done in spread(work, recordings, workers):
        done.result()
        ended.append(done)
        receive(len(ended))
    seconds = time.perf_counter() - start
    rows = _written(work, recordings)
    return {
        "workers": workers,
        "seconds": round(seconds, 2),
        "recording_s": round(median(row.seconds or 0.0 for row in rows), 2),
        "constraints": sum(row.constraints for row in rows),
    }


def _written(work: BatchWork, recordings: Sequence[Path]) -> list[Row]:
    rows = []
    with batch_tables(work.folder) as tables:
        for recording in recordings:
            summary = work.read(recording)
            if summary is None:
                raise OSError(f"{recording}: expected its result, got none")
            rows.append(Row.of(recording, work.file(recording).name, summary))
            tables.add_recording(rows[-1], summary)
    return rows


def same(one: Path, other: Path) -> bool:
    """Whether two runs found the same constraints and refusals, to the last digit."""
    read = pyarrow.parquet.read_table
    return all(read(one / f"{name}.parquet").equals(read(other / f"{name}.parquet")) for name in TABLES)


class Killer:
    """Kills one worker when so many recordings have ended."""

    def __init__(self, after: int) -> None:
        self._after = after

    def __call__(self, ended: int) -> None:
        """Receive how many have ended."""
        if ended == self._after:
            workers = [child for child in multiprocessing.active_children() if "Dask" in child.name]
            os.kill(int(workers[0].pid or 0), signal.SIGKILL)
            click.echo(f"killed process {workers[0].pid}", err=True)


def simulated(folder: Path, count: int, frames: int) -> list[Path]:
    """So many small loops, made where they are not there yet."""
    paths = [folder / f"loop_{seed}_{frames}" for seed in range(count)]
    sensors = sensors_of(camera_of("qvga", None), False, (), "kinect_v1")
    for seed, path in enumerate(paths):
        if not path.exists():
            part = path.with_name("part")
            shutil.rmtree(part, ignore_errors=True)
            simulate(part, "loop", seed, frames, sensors=sensors, jpeg=True)
            os.replace(part, path)
    return paths


def line(name: str, row: dict[str, Any], first: dict[str, Any]) -> str:
    """A line of the table."""
    times = first["seconds"] / row["seconds"]
    figures = f"{row['seconds']:>8.1f} {times:>6.2f} {row['recording_s']:>13.2f} {row['constraints']:>12}"
    return f"{name:16} {figures}  {'yes' if row['same'] else 'NO'}"


@click.command()
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option("--simulate", "count", default=24, show_default=True, help="Simulate so many, without RECORDINGS.")
@click.option("--frames", default=80, show_default=True, help="Frames of a simulated recording.")
@click.option("--workers", default="1,2", show_default=True, help="Counts of workers; the first is the measure.")
@click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/batch"), show_default=True)
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
def main(
    recordings: tuple[Path, ...], count: int, frames: int, workers: str, keep: Path, json_file: Path | None
) -> None:
    """Run RECORDINGS with each count of workers, and once more with one of them killed midway."""
    paths = [path.resolve() for path in recordings or simulated(keep, count, frames)]
    counts = [int(number) for number in workers.split(",")]
    runs = {f"{number}": (number, Killer(0)) for number in counts}
    runs[f"{counts[-1]}, one killed"] = (counts[-1], Killer(len(paths) // 2))
    rows: dict[str, dict[str, Any]] = {}
    click.echo(HEAD)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "warm").mkdir()
        measure(paths[:1], 1, Path(folder, "warm"))
        for name, (number, killer) in runs.items():
            place = Path(folder, name)
            place.mkdir()
            rows[name] = measure(paths, number, place, killer)
            rows[name]["same"] = same(Path(folder, next(iter(runs))), place)
            click.echo(line(name, rows[name], next(iter(rows.values()))))
    if json_file is not None:
        json_file.write_text(json.dumps({"recordings": len(paths), "runs": rows}, indent=1))


if __name__ == "__main__":
    main()
