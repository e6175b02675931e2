# SPDX-License-Identifier: Apache-2.0
"""What is the mapper worth? Against false closures, over kilometres, on recordings with truth, and on public graphs.

    python benchmarks/mapper.py robust --graphs 200 --seed 0
    python benchmarks/mapper.py scale --poses 40000 --closures 5000
    python benchmarks/mapper.py limits REC --simulate loop:0 --drifts 6
    python benchmarks/mapper.py landmarks REC --simulate loop:0 --drifts 6
    python benchmarks/mapper.py public sphere2500.g2o

``robust``: random walks with 10, 20 or 30 % false closures of any size and claimed sigma, a third of the walks with up
to 10 % that agree with each other. The error of the trajectory over that of our map without the false ones. The peers
have the same keyframes, steps and closures, those that our mapper refuses as implausible left out, and the same limit
and error of pictures.

``scale``: a walk through a building with 5 % false closures, solved after each.

``limits``: what the error of the trajectory comes from. Closures of a recording are found once and kept in a folder;
odometry drifts anew from its truth. Beside our closures those of the same pairs with true poses and the same
covariances, and with parts of the mapper, or of the closures, switched off or made perfect.

``landmarks``: whether objects help as landmarks. By plain Levenberg-Marquardt, with an error of each keyframe that all
its closures and sightings share: closures alone, and beside them ranges and bearings of objects, which are named by
place, by closures, by both as the registrar does, or by truth.

``public``: pose graphs as g2o text. Chi-squared before and after, beside GTSAM's Levenberg-Marquardt.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import map_landmarks
import map_lies
import map_limits
import map_public
import map_scale
from closure import plans, simulated
from map_peers import PEERS, chosen
from tqdm import tqdm

from objreg_mapper.params import MapperParams

KEPT = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "objreg_mapper"
JSON = click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write figures here.")


@click.group(help=__doc__)
def main() -> None:
    """The subcommands say it."""


def write(file: Path | None, figures: Any) -> None:
    """Figures as JSON, if asked for."""
    if file is not None:
        file.write_text(json.dumps(figures, indent=1))


def _peers(context: click.Context, parameter: click.Parameter, value: str) -> list[str]:
    try:
        return list(chosen(value))
    except ValueError as error:
        raise click.BadParameter(str(error)) from error


@main.command()
@click.option("--graphs", default=200, show_default=True, type=click.IntRange(1), help="How many random graphs.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Of the first of them.")
@click.option("--peers", default=",".join(PEERS), show_default=True, callback=_peers, help="Which, by comma.")
@click.option("--pairwise", is_flag=True, help="Ours with pairwise_consistency.")
@JSON
def robust(graphs: int, seed: int, peers: list[str], pairwise: bool, json_file: Path | None) -> None:
    """False closures on random graphs."""
    rows, params = list[dict[str, Any]](), MapperParams(pairwise_consistency=pairwise)
    with tqdm(total=graphs, desc="graphs") as bar:
        while len(rows) < graphs:
            row = map_lies.one(seed, peers, params)
            seed += 1
            if row is not None:
                rows.append(row)
                bar.update()
    click.echo(map_lies.table(rows))
    write(json_file, {"summary": map_lies.summary(rows), "graphs": rows})


@main.command()
@click.option("--poses", default=40000, show_default=True, type=click.IntRange(100), help="Of odometry, 27 cm each.")
@click.option("--closures", default=5000, show_default=True, type=click.IntRange(1), help="Right ones.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0))
@click.option("--peers/--no-peers", "with_peers", default=True, help="Other optimisers at once on the same walk.")
@JSON
def scale(poses: int, closures: int, seed: int, with_peers: bool, json_file: Path | None) -> None:
    """A walk of kilometres."""
    walk = map_scale.long_walk(poses, closures, seed)
    click.echo(map_scale.HEAD)
    figures = map_scale.ours(walk)
    write(json_file, figures)
    if not with_peers:
        return
    figures["short"] = map_scale.at_once(map_scale.shortened(walk, map_scale.SHORT_M), list(PEERS))
    click.echo(map_scale.rows_at_once(figures["short"]))
    figures["whole"] = map_scale.at_once(walk, ["GTSAM LM"], with_ours=False)
    click.echo(map_scale.rows_at_once(figures["whole"]))
    write(json_file, figures)


def _compared(command: Callable[..., None]) -> Callable[..., None]:
    """The recordings, drifts and files of a command."""
    for option in (
        JSON,
        click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=KEPT, show_default=True),
        click.option("--drifts", default=6, show_default=True, type=click.IntRange(1), help="Of odometry."),
        click.option("--frames", default=600, show_default=True, type=click.IntRange(2), help="Of each simulated one."),
        click.option("--simulate", "scenarios", multiple=True, metavar="SCENARIO:SEED,…", help="Such recordings too."),
        click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path)),
    ):
        command = option(command)
    return command


def _cases(recordings: tuple[Path, ...], scenarios: tuple[str, ...], frames: int, keep: Path) -> Iterator[Path]:
    asked = plans(scenarios)
    if not recordings and not asked:
        raise click.UsageError("expected RECORDINGS or --simulate SCENARIO:SEED, got neither")
    yield from recordings
    yield from (simulated(keep, name, seed, frames) for name, seed in asked)


@main.command()
@_compared
def limits(drifts: int, keep: Path, json_file: Path | None, **asked: Any) -> None:
    """What limits the trajectory."""
    figures = {}
    for path in _cases(keep=keep, **asked):
        case = map_limits.found(path, keep)
        figures[case.name] = map_limits.limits(case, drifts)
        click.echo(map_limits.table(case.name, figures[case.name]) + "\n")
        write(json_file, figures)


@main.command()
@_compared
def landmarks(drifts: int, keep: Path, json_file: Path | None, **asked: Any) -> None:
    """Whether objects help as landmarks."""
    figures = {}
    for path in _cases(keep=keep, **asked):
        case = map_limits.found(path, keep)
        figures[case.name] = map_landmarks.compare(case, map_landmarks.seen(path, keep), drifts)
        click.echo(map_landmarks.table(case.name, figures[case.name]) + "\n")
        write(json_file, figures)


@main.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--robust/--believed", "is_robust", default=True, show_default=True, help="Doubt closures, too.")
@JSON
def public(files: tuple[Path, ...], is_robust: bool, json_file: Path | None) -> None:
    """Pose graphs that others publish, as g2o text."""
    figures = {}
    for file in files:
        try:
            graph = map_public.read(file)
        except (ValueError, RuntimeError) as error:
            raise click.BadParameter(str(error), param_hint="FILES") from error
        figures[graph.name] = map_public.compare(graph, is_robust)
        click.echo(map_public.table(graph.name, figures[graph.name]) + "\n")
        write(json_file, figures)


if __name__ == "__main__":
    main()
