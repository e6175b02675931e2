# SPDX-License-Identifier: Apache-2.0
"""`objreg merge`: several stores as one, tied together."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import click
from tqdm import tqdm

from objreg_mapper.params import MapperParams
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli import options
from objreg_tools.cli.paths import InputPath, InputText, OutputPath
from objreg_tools.cli.run_output import json_to, print_next
from objreg_tools.cli.settings import print_ignored, read_settings
from objreg_tools.merge.figures import described, evaluate, figures
from objreg_tools.merge.merge_page import merge_page
from objreg_tools.merge.merging import Merged, merge
from objreg_tools.merge.unfinished import unfinished_path
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.report.store.store_summary import survey
from objreg_tools.truth import Truth, Truths


@click.command()
@click.argument("stores", nargs=-1, required=True, type=InputPath(path_type=Path), metavar="STORES…")
@click.option(
    "-o", "--out", required=True, type=OutputPath(dir_okay=False, path_type=Path), help="The merged store, a new file."
)
@click.option(
    "--truth",
    "truths",
    multiple=True,
    type=InputText(),
    metavar="[ROBOT=]RECORDING",
    help="A recording with the true path of a robot, by its name in the merged store; of all robots without a name. "
    "All paths are in one world.",
)
@click.option(
    "--page",
    type=OutputPath(dir_okay=False, path_type=Path),
    metavar="FILE.html",
    help="Before and after as a page, with the ties, what contradicts and what moved.",
)
@options.change
@options.params
@options.json_out
def command(
    stores: tuple[Path, ...],
    out: Path,
    truths: tuple[str, ...],
    page: Path | None,
    changes: tuple[str, ...],
    params_file: Path | None,
    json_file: Path | None,
) -> None:
    """Merge STORES of the registrar, of several robots or days, into one new store, and tie them together.

    All keyframes, objects and closures are kept, under new numbers; a robot's name that two stores use gets the name
    of its store before it. Keyframes are searched for in the stores before their own, as the registrar does. Shows how
    the stores are tied, and what contradicts. STORES are not changed, and no node may write them meanwhile.

    A merge that was interrupted goes on where it was, when it is called again. The merged store has its name only once
    it is complete.
    """
    settings = read_settings(params_file, changes)
    print_ignored(settings)
    with json_to(json_file) as write_json:
        merged = _merged(stores, out, settings.of("registrar", RegistrarParams))
        for line in merged.damaged:
            click.echo(f"! left out: {line}", err=True)
        found = evaluate(merged, settings.of("mapper", MapperParams))
        known = _truths(truths, [name for store in merged.stores for name in store["robots"].values()])
        write_json(figures(found, known))
        click.echo(described(found, known))
        if page is not None:
            write_whole(page, merge_page(found, survey(out), known))
            click.echo(f"  written into {page}")
    print_next("objreg", "inspect", str(out), "--page", f"{out.stem}.html")


def _merged(stores: Sequence[Path], out: Path, params: RegistrarParams) -> Merged:
    """The merge under a bar of keyframes."""
    with tqdm(total=None, desc="merge", unit=" keyframes", disable=None) as bar:

        def report(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        try:
            return merge(stores, out, params, report)
        except BaseException:
            unfinished = unfinished_path(out)
            if unfinished.exists():
                bar.write(f"! not complete: the same command goes on with {unfinished}", file=sys.stderr)
            raise


def _truths(given: Sequence[str], robots: Sequence[str]) -> Truths | None:
    """The true paths; None where none is given. ValueError for a robot that is not there."""
    of_robots: dict[str, Truth] = {}
    for text in given:
        name, sign, path = text.rpartition("=")
        if sign and name not in robots:
            raise ValueError(f"--truth: expected one of the robots {', '.join(robots)}, got {name!r}")
        with open_recording(Path(path)) as source:
            truth = Truth.of(source, choose_inputs(source.topics, {}).ground_truth)
        if not truth.poses:
            raise ValueError(f"--truth: expected a recording with the true path of its camera, got none in {path}")
        of_robots |= dict.fromkeys([name] if sign else robots, truth)
    return Truths(of_robots) if of_robots else None
