# SPDX-License-Identifier: Apache-2.0
"""Does it close loops? Ours and its peers on the same recordings, by truth, in one run.

For every recording and method: constraints, true ones (within 5 degrees and 10 cm), false ones (worse than 8 degrees or
15 cm), the share of the revisits that were closed by view change, the processor's milliseconds a pair, and the error of
the trajectory by drifting odometry and after the same pose graph took the method's constraints. The oracle's
constraints are perfect and there is one for every revisit: what is left then, no closing of loops can take away. Pairs
alone are ours without what neighbouring keyframes say. In simulation our constraints know that the camera is calibrated
well (covariance_calibration); all else is default.

    python benchmarks/closure.py --quick
    python benchmarks/closure.py --simulate loop:0,1,2,3,4 --simulate moved:0,1,2,3,4 --json OUT --figure closure.png
    python benchmarks/closure.py REC --model MODEL

Simulated recordings are kept in a folder, and so are the figures of every method, so that another run of the same code
goes on where one ended; ``--again objreg`` measures a method anew.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import closers
from closure_table import draw, grouped, table, table_of_totals, totals
from command_line import quick_values
from peers import PEERS, named
from sources import NO_JITTER, Jitter, Source, detector_of, read_source

import objreg_ros
from objreg_ros.detector.params import DetectorParams
from objreg_ros.whole_file import write_whole
from objreg_tools.simulation.scenarios import SCENARIOS
from objreg_tools.simulation.write import simulate
from objreg_tools.workers import spread

OURS, ALONE, ORACLE = "objreg", "objreg, pairs alone", "oracle"
QUICK = {"frames": 300, "names": ("orb_pnp",), "candidates": 1}
QUICK_STORY = ("loop:0",)


@dataclass(frozen=True)
class Asked:
    """What is compared, and how."""

    detector: DetectorParams
    names: tuple[str, ...]
    candidates: int
    seed: int
    drift: float
    jitter: Jitter = NO_JITTER

    @property
    def methods(self) -> tuple[str, ...]:
        """The names of all methods."""
        return (OURS, ALONE, *self.names, ORACLE)

    def tag(self) -> str:
        """What the figures depend on, as a part of a file's name."""
        usual = detector_of()
        model = "default" if self.detector.model == usual.model else Path(self.detector.model).stem
        parts = [code(), model, f"{self.candidates}", f"{self.seed}"]
        parts += [f"{self.detector.threshold:g}"] if self.detector.threshold != usual.threshold else []
        parts += [f"x{self.drift:g}"] if self.drift != 1.0 else []
        parts += ["j{:g}-{:g}".format(*self.jitter)] if self.jitter != NO_JITTER else []
        return "_".join(parts)


def code() -> str:
    """Eight digits that change with the packages and the benchmarks."""
    root = Path(objreg_ros.__file__).parents[1]
    files = [file for folder in (*root.glob("objreg_*"), Path(__file__).parent) for file in folder.rglob("*.py")]
    return hashlib.sha1(b"".join(file.read_bytes() for file in sorted(files))).hexdigest()[:8]


class Kept:
    """The figures of one recording in a file, written after every method."""

    def __init__(self, file: Path, again: Sequence[str]) -> None:
        self._file = file
        self.row: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {"methods": {}}
        for name in again:
            self.row["methods"].pop(name, None)

    def missing(self, names: Sequence[str]) -> list[str]:
        """The methods of which there is nothing yet."""
        return [name for name in names if name not in self.row["methods"]]

    def write(self) -> None:
        """Write the file in one go."""
        self._file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(self._file, json.dumps(self.row))


def compare(path: Path, asked: Asked, kept: Kept) -> dict[str, Any]:
    """Every method on one recording; those that were measured before come from ``kept``."""
    missing = kept.missing(asked.methods)
    known = [name for name in asked.methods if name not in missing]
    if known:
        click.echo(f"{path.name}: {', '.join(known)} as measured before; --again METHOD measures anew", err=True)
    if missing:
        click.echo(f"{path.name}: detecting and segmenting", err=True)
        with read_source(path, asked.detector, asked.seed, asked.drift, asked.jitter) as source:
            _measure(source, asked, missing, kept)
    methods = {name: kept.row["methods"][name] for name in asked.methods}
    return {**kept.row, "methods": methods}


def _measure(source: Source, asked: Asked, names: Sequence[str], kept: Kept) -> None:
    keyframes = closers.keyframes_of(source.frames)
    found = closers.loops_of(keyframes, source.truth)
    pairs = closers.candidate_pairs(keyframes, asked.candidates)
    work = {OURS: partial(closers.ours, source, asked.seed), ORACLE: partial(closers.oracle, source, found)}
    work[ALONE] = partial(closers.ours, source, asked.seed, confirm_seconds=0.0)
    work |= {name: partial(closers.theirs, PEERS[name](), source, keyframes, pairs) for name in asked.names}
    kept.row |= {"frames": len(source.frames), "keyframes": len(keyframes), "revisits": len(found)}
    kept.row["path_m"] = round(source.truth.length, 2)
    for name in names:
        click.echo(f"  {name}", err=True)
        kept.row["methods"][name] = closers.judged(work[name](), source, found)
        kept.write()


def simulated(folder: Path, scenario: str, seed: int, frames: int) -> Path:
    """The recording of a scenario, made if it is not there yet."""
    path = folder / f"{scenario}_{seed}_{frames}" / f"{scenario}_{seed}"
    if not path.exists():
        click.echo(f"{path.name}: simulating {frames} frames", err=True)
        unfinished = path.with_name("part")
        _remove(unfinished)
        simulate(unfinished, scenario, seed, frames, jpeg=True, threads=1)
        os.replace(unfinished, path)
    return path


def _remove(folder: Path) -> None:
    import shutil

    shutil.rmtree(folder, ignore_errors=True)


def plans(texts: Sequence[str]) -> list[tuple[str, int]]:
    """``loop:0,1`` as (loop, 0), (loop, 1); `click.BadParameter` for what is no scenario or no seed."""
    found = []
    for text in texts:
        name, _, seeds = text.partition(":")
        numbers = (seeds or "0").split(",")
        if name not in SCENARIOS or not all(number.isdecimal() for number in numbers):
            expected = f"SCENARIO:SEED,SEED… with a scenario of {', '.join(SCENARIOS)} and seeds from 0"
            raise click.BadParameter(f"expected {expected}, got {text!r}", param_hint="--simulate")
        found += [(name, int(number)) for number in numbers]
    return found


def jitter_of(context: click.Context, parameter: click.Parameter, text: str) -> Jitter:
    """``3,4`` as 3 degrees and 4 cm; `click.BadParameter` for what is no two numbers from 0 to 45 and 100."""
    try:
        degrees, cm = (float(number) for number in text.split(","))
    except ValueError:
        degrees = cm = -1.0
    if not (0.0 <= degrees <= 45.0 and 0.0 <= cm <= 100.0):
        raise click.BadParameter(f"expected DEG,CM with numbers from 0 to 45 and from 0 to 100, got {text!r}")
    return degrees, cm


def _require_own_names(names: Sequence[str]) -> None:
    """Figures are kept and shown by the name of the recording; `click.UsageError` where two have one."""
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        raise click.UsageError(f"expected recordings of different names, got more than one {', '.join(twice)}")


def _compared(
    make: Callable[[], Path], asked: Asked, frames: int, keep: Path, again: Sequence[str]
) -> tuple[str, dict[str, Any]]:
    """The name of a recording, which is made where it is not there, and its figures."""
    path = make()
    kept = Kept(keep / "figures" / f"{path.name}_{frames}_{asked.tag()}.json", again)
    return path.name, compare(path, asked, kept)


def paths_of(
    recordings: Sequence[Path], scenarios: Sequence[tuple[str, int]], frames: int, keep: Path
) -> list[Callable[[], Path]]:
    """What gives the path of each recording; simulated ones are made then, and kept. UsageError where there is none."""
    if not recordings and not scenarios:
        raise click.UsageError("expected RECORDINGS or --simulate SCENARIO:SEED, got neither")
    made = [partial(simulated, keep, name, seed, frames) for name, seed in scenarios]
    return [*(partial(Path, path) for path in recordings), *made]


@click.command()
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option(
    "--simulate",
    "scenarios",
    multiple=True,
    metavar="SCENARIO:SEED,SEED…",
    help="Simulate these recordings and use them.",
)
@click.option("--frames", default=600, show_default=True, help="Frames of a simulated recording.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--figure", type=click.Path(dir_okay=False, path_type=Path), help="Draw them here (svg, png).")
@click.option("--model", default="", help="ONNX model; `truth`: a simulation's boxes; `nothing`: none.")
@click.option("--threshold", default=0.5, show_default=True, help="Least score of a detection; COCO models want 0.4.")
@click.option(
    "--peers", "names", default="orb_pnp,fpfh_icp,paper", show_default=True, callback=named, help="Compared with these."
)
@click.option("--candidates", default=1, show_default=True, help="Pairs that a peer may try for each keyframe.")
@click.option("--seed", default=1, show_default=True, help="Seed of the synthetic drift and of the registrar.")
@click.option("--drift", default=1.0, show_default=True, help="Synthetic odometry drifts so many times 2 % and 1°/m.")
@click.option(
    "--jitter",
    default="0,0",
    show_default=True,
    metavar="DEG,CM",
    callback=jitter_of,
    help="Each pose of odometry errs by this for itself, besides.",
)
@click.option(
    "--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/closure"), show_default=True
)
@click.option("--again", multiple=True, metavar="METHOD", help="Measure this method anew.")
@click.option("--workers", type=click.IntRange(min=1), default=1, show_default=True, help="Recordings at once.")
@click.option("--quick", is_flag=True, help="One peer, and one short loop without RECORDINGS.")
@click.pass_context
def main(
    context: click.Context,
    recordings: tuple[Path, ...],
    keep: Path,
    again: tuple[str, ...],
    quick: bool,
    **options: Any,
) -> None:
    """Compare loop closure on RECORDINGS that have ground truth."""
    options |= quick_values(context, quick, QUICK if recordings else QUICK | {"scenarios": QUICK_STORY})
    scenarios = plans(options["scenarios"])
    detector = detector_of(options["model"], options["threshold"])
    asked = Asked(
        detector, options["names"], options["candidates"], options["seed"], options["drift"], options["jitter"]
    )
    paths = paths_of(recordings, scenarios, options["frames"], keep)
    names = [*(path.name for path in recordings), *(f"{name}_{seed}" for name, seed in scenarios)]
    _require_own_names(names)
    work = partial(_compared, asked=asked, frames=options["frames"], keep=keep, again=again)
    rows: dict[str, dict[str, Any]] = {}
    for done in spread(work, paths, options["workers"]):
        name, row = done.result()
        rows[name] = row
        click.echo(table(name, row))
    rows = {name: rows[name] for name in names}  # whichever ended first
    by_group = {group: totals(list(members.values())) for group, members in grouped(rows).items()}
    for group, methods in by_group.items():
        click.echo(table_of_totals(group, methods))
    if options["json_file"] is not None:
        result = {"recordings": rows, "by_scenario": by_group, "total": totals(list(rows.values()))}
        options["json_file"].write_text(json.dumps(result, indent=1))
    if options["figure"] is not None:
        draw(rows, options["figure"])


if __name__ == "__main__":
    main()
