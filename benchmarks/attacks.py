# SPDX-License-Identifier: Apache-2.0
"""Attacks: spoilt messages into every decoder, stage and live node, hostile peers, files and servers.

    python benchmarks/attacks.py --seconds 900 --json attacks.json
    python benchmarks/attacks.py --only frame --seed 1234

For each target the trials, how many of them were refused as they should be (ValueError or OSError), and the findings:
``bug`` (another exception; in a node it is caught at the node), ``death`` (the end of the process), ``hang`` (more than
5 s of the processor, or 30 s of waiting), ``greed`` (more than 500 MB), ``wrong`` (an answer that is not true, without
an error) and ``outside`` (a file written outside of the folder that was given). The JSON holds every kind of finding
with seeds; ``--only TARGET --seed S`` makes that trial again, and shows the traceback. ``decoded`` are the messages
that went through decoders and stages, ``live`` those that were published to nodes in processes of their own, and the
calls of their services. The exit status is 1 where anything was found. The groups of targets:

\b
decoders  every kind of message            rooms     what is done with it
peers     packed keyframes, summaries, requests, deliveries: an honest peer must still be served
files     stores, recordings, models       results   folders of a batch, saved maps
commands  outputs that are inputs, fetch-model from a hostile server
live      spoilt messages to each node     calls     parameters at extremes, services in floods
"""

from __future__ import annotations

import json
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attacked_calls
import attacked_commands
import attacked_files
import attacked_messages
import attacked_nodes
import attacked_peers
import attacked_results
import attacked_rooms
import click
from tqdm import tqdm
from trials import KINDS, Target, judged, run_trials

GROUPS: dict[str, Sequence[Target]] = {
    "decoders": attacked_messages.TARGETS,
    "rooms": attacked_rooms.TARGETS,
    "peers": attacked_peers.TARGETS,
    "files": attacked_files.TARGETS,
    "results": attacked_results.TARGETS,
    "commands": attacked_commands.TARGETS,
}
LIVE_GROUPS = {"live": attacked_nodes.TARGETS, "calls": attacked_calls.TARGETS}
LIVE = {name: share for targets in LIVE_GROUPS.values() for name, share in targets.items()}
SHARES = {"decoders": 0.2, "rooms": 0.15, "peers": 0.1, "files": 0.15, "results": 0.05, "commands": 0.05}  # of the time
SHARES |= {"live": 0.15, "calls": 0.15}
TARGETS = {target.name: target for targets in GROUPS.values() for target in targets}
BY_GROUP = {**{name: {t.name: t.share for t in targets} for name, targets in GROUPS.items()}, **LIVE_GROUPS}
NAMES = (*TARGETS, *LIVE)


def seconds_of(chosen: Sequence[str], seconds: float) -> dict[str, float]:
    """How long each target has: the groups by `SHARES`, within them by the targets' own."""
    weights: dict[str, float] = {}
    for group, targets in BY_GROUP.items():
        whole = sum(share for name, share in targets.items() if name in chosen)
        weights |= {name: SHARES[group] * share / whole for name, share in targets.items() if name in chosen}
    return {name: seconds * weight / sum(weights.values()) for name, weight in weights.items()}


def attack(chosen: Sequence[str], seconds: float, workers: int, first: int) -> dict[str, dict[str, Any]]:
    """The row of every target."""
    rows = {}
    times = seconds_of(chosen, seconds)
    for name in (bar := tqdm(times, desc="attacks")):
        bar.set_postfix_str(name)
        if name in TARGETS:
            rows[name] = run_trials(TARGETS[name], times[name], workers, first).row()
        else:
            rows[name] = attacked_nodes.run_live(name, times[name], first).row()
    return rows


def summary(rows: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The counts over all targets."""
    messages = [t.name for group in ("decoders", "rooms", "peers") for t in GROUPS[group]]
    return {
        "decoded": sum(rows[name]["tries"] for name in messages if name in rows),
        "live": sum(rows[name]["tries"] for name in LIVE if name in rows),
        **{kind: sum(row[kind] for row in rows.values()) for kind in KINDS},
    }


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The rows as text."""
    head = ("target", "tries", "refused", *KINDS)
    lines = ["".join(f"{title:>9}" if k else f"{title:<20}" for k, title in enumerate(head))]
    for name, row in rows.items():
        lines.append(f"{name:<20}" + "".join(f"{row[key]:>9}" for key in head[1:]))
        for found in row["findings"]:
            lines.append(f"    {found['count']} × {found['kind']}: {found['what'][:120]} at {found['where']}")
            lines.append(f"      --only {name} --seed {found['seeds'][0]}")
    return "\n".join(lines)


def replay(name: str, seed: int) -> bool:
    """Make one trial again, first in a process that may die, then, if it did not, here; True if nothing was found."""
    if name in LIVE:
        row = attacked_nodes.run_live(name, 0.0, seed).row()
        print(table({name: row}))
        return not row["findings"]
    row = run_trials(TARGETS[name], float("inf"), 1, seed, 1).row()
    print(table({name: row}))
    if not row["death"] and not row["hang"]:
        with tempfile.TemporaryDirectory() as folder:
            kind, error = judged(TARGETS[name].prepare(Path(folder)), seed)
        print(kind)
        if error is not None:
            traceback.print_exception(error)
    return not row["findings"]


def _names(_: click.Context, __: click.Parameter, text: str | None) -> tuple[str, ...]:
    asked = NAMES if text is None else tuple(n for part in text.split(",") for n in BY_GROUP.get(part, [part]))
    if set(asked) - set(NAMES):
        raise click.BadParameter(f"expected some of {','.join((*BY_GROUP, *NAMES))}, got {text!r}")
    return asked


@click.command(help=__doc__)
@click.option("--seconds", type=click.FloatRange(min=1), default=60.0, show_default=True, help="Of all targets.")
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--only", callback=_names, help="Targets or groups of them, by commas.")
@click.option("--seed", type=click.IntRange(min=0), help="Make this trial of one target again.")
@click.option("--first", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the first trial.")
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Processes at once.")
def main(seconds: float, out: Path | None, only: tuple[str, ...], seed: int | None, first: int, workers: int) -> None:
    """Attack and print."""
    if seed is not None:
        if len(only) != 1:
            raise click.UsageError(f"expected --only with one target beside --seed, got {len(only)}")
        sys.exit(0 if replay(only[0], seed) else 1)
    rows = attack(only, seconds, workers, first)
    figures = {**summary(rows), "targets": rows}
    print(table(rows))
    print(json.dumps(summary(rows)))
    if out is not None:
        out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    sys.exit(1 if any(row["findings"] for row in rows.values()) else 0)


if __name__ == "__main__":
    main()
