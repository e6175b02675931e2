# SPDX-License-Identifier: Apache-2.0
"""Recordings that are wrong about themselves: how many false constraints they give, and whether the cause is named.

Right recordings, real and simulated, get faults of `stream_faults` with magnitudes at random: another focal length, a
clock that is off, odometry of another robot, and so on. Each is run offline with the defaults. A case loses closures
where fewer than 0.8 of the constraints of the right recording are left, or any is false.

    python benchmarks/streams.py TUM_FOLDER TUM_FOLDER --model COCO.onnx --threshold 0.4 --json OUT
    python benchmarks/streams.py --simulate robot:3 --kinds focal,mount_wrong --cases 20
    python benchmarks/streams.py TUM_FOLDER --model COCO.onnx --threshold 0.4 --parts mount --cases 12
    python benchmarks/streams.py TUM_FOLDER --model COCO.onnx --threshold 0.4 --shared FOLDER

``--parts mount`` asks how much is lost where nobody says how the camera sits on the body. ``--shared`` runs every CASE
of the scripts of a folder. ``--model`` is for RECORDINGS; simulated ones are detected in by the embedded model.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from stream_cases import Case, Row, judged, references, run_case
from stream_faults import KINDS
from stream_generators import SCRIPTS, Written, cases_of, run_generator
from stream_grounds import ROBOT, Ground, simulated
from stream_table import by_kind, mount_table, shared_table, table, totals
from tqdm import tqdm

from objreg_ros import share
from objreg_tools.simulation.scenarios import SCENARIOS
from objreg_tools.workers import spread

PARTS = ("faults", "mount")


def cases(kinds: Sequence[str], grounds: Sequence[Ground], count: int, frames: int, first: int = 0) -> list[Case]:
    """So many cases, spread evenly over kinds and grounds; their seeds count up from ``first``."""
    return [_case(kinds[k % len(kinds)], k // len(kinds), grounds, first + k, frames) for k in range(count)]


def _case(kind: str, place: int, grounds: Sequence[Ground], seed: int, frames: int) -> Case:
    wanted = KINDS[kind].odometry
    odometry = bool(np.random.default_rng(seed).random() < 0.5) if wanted is None else wanted
    ground, other = (grounds[k % len(grounds)] for k in (place, place + 1))
    return Case(kind, ground, other, seed, odometry, frames)


def measured(asked: Sequence[Case], workers: int) -> list[Row]:
    """The rows of the cases, judged; those of the recordings that they are compared with come first."""
    items = sorted([*references(asked), *asked], key=lambda case: case.ground.name)
    return judged(_spread(run_case, items, workers, "case"))


def _spread(work: Callable[[Any], Row], items: Sequence[Any], workers: int, unit: str) -> list[Row]:
    """What the work gives of the items, in their order."""
    rows: dict[int, Row] = {}
    numbered = list(enumerate(items))
    for done in tqdm(spread(partial(_numbered, work), numbered, workers), total=len(items), unit=unit, disable=None):
        rows[done.item[0]] = done.result()
    return [rows[k] for k, _ in numbered]


def _numbered(work: Callable[[Any], Row], item: tuple[int, Any]) -> Row:
    return work(item[1])


def grounds_of(recordings: Sequence[Path], model: str, threshold: float, texts: Sequence[str], keep: Path) -> list:
    """The grounds: recordings, and simulations by ``SCENARIO:SEED``. `click.BadParameter` for what names none."""
    named = [text.partition(":")[::2] for text in texts]
    for (scenario, seed), text in zip(named, texts, strict=True):
        if scenario not in (*SCENARIOS, ROBOT) or not seed.isdecimal():
            expected = f"SCENARIO:SEED with a scenario of {', '.join((*SCENARIOS, ROBOT))} and a seed from 0"
            raise click.BadParameter(f"expected {expected}, got {text!r}", param_hint="--simulate")
    real = [Ground(path.name, path.resolve(), model or share.EMBEDDED, threshold) for path in recordings]
    return [*real, *(simulated(keep, scenario, int(seed)) for scenario, seed in named)]


def some_of(known: Sequence[str], _context: click.Context, option: click.Parameter, text: str) -> tuple[str, ...]:
    """Names separated by commas, each of ``known``; `click.BadParameter` for others."""
    names = tuple(text.split(","))
    if not set(names) <= set(known):
        raise click.BadParameter(f"expected some of {','.join(known)}, got {text!r}", param=option)
    return names


def shared_cases(folder: Path, data: Sequence[Path], step: int, model: str, threshold: float) -> list[Written]:
    """Every case of the scripts in a folder; `click.UsageError` where there are none, or nothing to make them of."""
    scripts = [folder / name for name in SCRIPTS if (folder / name).is_file()]
    if not scripts or not data:
        raise click.UsageError(f"--shared: expected {' or '.join(SCRIPTS)} in {folder}, and a TUM folder as RECORDINGS")
    of = partial(Written, data=data[0].resolve(), step=step, model=model or share.EMBEDDED, threshold=threshold)
    return [of(script.resolve(), case) for script in scripts for case in cases_of(script)]


@click.command()
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--simulate",
    "scenarios",
    multiple=True,
    default=("loop:11", "moved:12", "robot:13"),
    show_default=True,
    metavar="SCENARIO:SEED",
    help="Use this simulated recording too; may be repeated. Empty for none.",
)
@click.option("--cases", "count", type=click.IntRange(min=1), default=300, show_default=True, help="How many in all.")
@click.option(
    "--kinds",
    default=",".join(KINDS),
    callback=partial(some_of, tuple(KINDS)),
    help="These kinds of faults, separated by commas; all by default.",
)
@click.option(
    "--parts", default="faults", show_default=True, callback=partial(some_of, PARTS), help="What is measured."
)
@click.option("--shared", type=click.Path(exists=True, file_okay=False, path_type=Path), help="Only run these scripts.")
@click.option("--step", default=3, show_default=True, help="Scripts of --shared take every n-th frame.")
@click.option("--frames", type=click.IntRange(min=10), default=80, show_default=True, help="Frames of a case at most.")
@click.option("--seed", default=0, show_default=True, help="Seed of the first case; the others count up.")
@click.option("--model", default="", help="ONNX model for RECORDINGS.")
@click.option("--threshold", default=0.5, show_default=True, help="Least score of a detection; COCO models want 0.4.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Cases at once.")
@click.option(
    "--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/streams"), show_default=True
)
def main(recordings: tuple[Path, ...], shared: Path | None, json_file: Path | None, **options: Any) -> None:
    """Run RECORDINGS (TUM RGB-D folders with ground truth) and simulated ones with faults in them."""
    model = str(Path(options["model"]).resolve()) if Path(options["model"]).is_file() else options["model"]
    threshold, workers = options["threshold"], options["workers"]
    result: dict[str, Any] = {}
    if shared is not None:
        written = shared_cases(shared, recordings, options["step"], model, threshold)
        result["shared"] = _spread(run_generator, written, workers, "recording")
        click.echo(shared_table(result["shared"]))
    else:
        texts = [text for text in options["scenarios"] if text]
        grounds = grounds_of(recordings, model, threshold, texts, options["keep"])
        of = partial(cases, grounds=grounds, count=options["count"], frames=options["frames"], first=options["seed"])
        if "faults" in options["parts"]:
            rows = measured(of(options["kinds"]), workers)
            result["faults"] = {"rows": rows, "by_kind": by_kind(rows), "total": totals(rows)}
            click.echo(table(rows))
        if "mount" in options["parts"]:
            rows = [row for row in measured(of(("mount_unknown",)), workers) if not row["is_reference"]]
            result["mount"] = rows
            click.echo(mount_table(rows))
    if json_file is not None:
        json_file.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
