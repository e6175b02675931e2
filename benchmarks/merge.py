# SPDX-License-Identifier: Apache-2.0
"""Stores of several robots merged, beside one registrar of them all: closures between robots, and the map's error.

    python benchmarks/merge.py --seeds 1,2 --json merge.json
    python benchmarks/merge.py --quick

Each seed is a simulated building through which three robots drive (`benchmarks/robots.py`). ``one registrar`` takes
the frames of all three by their stamps. For ``merged`` each robot has a registrar and a store of its own, and
`objreg merge` ties the three. ``both buildings`` merges the stores of two buildings: no closure between them is true.
Detections are the simulation's own unless ``--model`` names one.

``between`` counts the closures between robots and ``false`` those that are wrong (8 degrees, 15 cm); ``stretches``
are the meetings of two robots that are tied, as `benchmarks/fleet.py` counts them. ``map_cm`` is the error of one map
of all robots with all odometry, ``keyframes_cm`` that of the stored keyframes alone, as `objreg merge --truth` has it.
"""

from __future__ import annotations

import json
import resource
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import fleet
from robots import PARAMS, Team, in_order, map_error_cm, meetings_of, simulated, team_of
from sources import TRUE_BOXES
from tqdm import tqdm

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.store import Store
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.merge.figures import evaluate
from objreg_tools.merge.merging import merge
from objreg_tools.merge.one_map import one_maps, tracks_of
from objreg_tools.truth import FALSE, Truths, within

QUICK_FRAMES = 150
HEAD = "| building | how | between | false | stretches | map cm | keyframes cm | closures | keyframes | s |"


def stored(team: Team, path: Path) -> Path:
    """The store of one registrar that takes the frames of these robots."""
    registrar = Registrar(PARAMS.replaced(store=str(path)))
    for frame in tqdm(list(in_order(team)), desc=path.stem, leave=False):
        registrar.process(frame)
    registrar.finish()
    registrar.close()
    return path


def closures_of(path: Path) -> tuple[list[LoopClosure], int]:
    """The closures of a store, and how many keyframes it has."""
    store = Store(path, read_only=True)
    try:
        return list(store.closures()), store.counts()["keyframes"]
    finally:
        store.close()


def keyframes_cm(path: Path, truths: Truths) -> float | None:
    """The error of the largest map of a store."""
    store = Store(path, read_only=True)
    try:
        error = one_maps(tracks_of(store), list(store.closures()))[0].error_cm(truths)
    finally:
        store.close()
    return None if error is None else error[0]


def row(path: Path, team: Team, found: Sequence[fleet.Meeting], seconds: float) -> dict[str, Any]:
    """The figures of one store of all robots."""
    closures, keyframes = closures_of(path)
    truths = Truths({name: robot.truth for name, robot in team.items()})
    judged = fleet.judged(found, closures, truths)
    return {
        "between": judged["constraints"],
        "false": sum(not within(error, FALSE) for error in truths.errors(closures)),
        "stretches": judged["stretches"],
        "meetings": judged["keyframes"],
        "map_cm": map_error_cm(team, closures),
        "keyframes_cm": keyframes_cm(path, truths),
        "closures": len(closures),
        "keyframes": keyframes,
        "seconds": seconds,
    }


def building(team: Team, folder: Path) -> dict[str, Any]:
    """One building: its three robots in one registrar, and merged."""
    found, began = meetings_of(team), time.monotonic()
    one = stored(team, folder / "one.db")
    rows = {"one registrar": row(one, team, found, time.monotonic() - began)}
    own = [stored({name: robot}, folder / f"{name}.db") for name, robot in team.items()]
    began = time.monotonic()
    merged = merge(own, folder / "merged.db", PARAMS)
    rows["merged"] = row(merged.path, team, found, time.monotonic() - began) | {"search": merged.counts}
    rows["merged"]["contradictions"] = len(evaluate(merged).contradictions)
    rows["merged"]["share"] = rows["merged"]["between"] / max(rows["one registrar"]["between"], 1)
    return rows


def both_buildings(folders: Sequence[Path], place: Path) -> dict[str, Any]:
    """All stores of two buildings merged: closures between the two are false."""
    began = time.monotonic()
    merged = merge([path / "merged.db" for path in folders], place, PARAMS)
    ties = evaluate(merged).ties
    return {"between": len(ties), "false": len(ties), "seconds": time.monotonic() - began, "search": merged.counts}


def line(name: str, how: str, of: Mapping[str, Any]) -> str:
    """A row of the table."""
    tied = f"{of['stretches']['closed']}/{of['stretches']['of']}" if "stretches" in of else "-"
    errors = ["-" if of.get(key) is None else f"{of[key]:.2f}" for key in ("map_cm", "keyframes_cm")]
    cells = [name, how, of["between"], of["false"], tied, *errors]
    cells += [of.get("closures", "-"), of.get("keyframes", "-"), f"{of['seconds']:.0f}"]
    return f"| {' | '.join(map(str, cells))} |"


@click.command()
@click.option("--seeds", default="1,2", show_default=True, help="Of the buildings.")
@click.option("--frames", default=300, show_default=True, help="Of each robot.")
@click.option("--quick", is_flag=True, help=f"One building of {QUICK_FRAMES} frames a robot.")
@click.option("--model", default=TRUE_BOXES, show_default=True, help="ONNX model; `truth`: the simulation's boxes.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/robots"), show_default=True)
def main(seeds: str, frames: int, quick: bool, model: str, json_file: Path | None, keep: Path) -> None:
    """Merge stores, and say how well."""
    numbers, frames = (seeds.split(",")[:1], QUICK_FRAMES) if quick else (seeds.split(","), frames)
    figures: dict[str, Any] = {}
    click.echo(f"{HEAD}\n|{' --- |' * (HEAD.count('|') - 1)}")
    with TemporaryDirectory() as temporary:
        folders = [Path(temporary, number) for number in numbers]
        for number, folder in zip(numbers, folders, strict=True):
            folder.mkdir()
            figures[number] = building(team_of(simulated(int(number), frames, keep), keep, model), folder)
            for how, of in figures[number].items():
                click.echo(line(number, how, of))
        if len(folders) > 1:
            figures["both"] = {"both buildings": both_buildings(folders[:2], Path(temporary, "both.db"))}
            click.echo(line("both", "merged", figures["both"]["both buildings"]))
    figures["megabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    if json_file is not None:
        json_file.write_text(json.dumps(figures, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
