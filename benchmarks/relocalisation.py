# SPDX-License-Identifier: Apache-2.0
"""Does it know where it woke up? Sessions of one place: an earlier one in the store, later ones begun anywhere.

The first half of a recording is the earlier session. The later sessions begin at several moments of its second half,
each beside a copy of the store, in odometry that begins anew at the camera. A known object is seen once one that the
earlier session stored is (by label and true place, within 30 cm). Counted is the share of starts that saw one for five
seconds and were relocated by then, the time that it took, and false starts: a first answer that is worse than 8 degrees
or 15 cm (FALSE) in the earlier session's odometry, as that was at the keyframe that the answer is by. For where
that session passed a place twice, its drift gives the place two positions in its map. Later answers are judged alike
and counted apart as drifted: between two closures both sessions' odometry drifts, as the covariance of an answer says.

    python benchmarks/relocalisation.py --quick
    python benchmarks/relocalisation.py --simulate moved:0,1,2,3,4 --simulate loop:0,1,2,3,4 --starts 4 --json OUT
    python benchmarks/relocalisation.py REC --threshold 0.4 --starts 6
    python benchmarks/relocalisation.py --days --simulate days:100,101 --json OUT

With --days the second half is one session, and each of its keyframes is judged: see `days.py`.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import click
import cv2
import days
import numpy as np
from closure import paths_of, plans
from command_line import quick_values
from sessions import LATER_NS, Earlier, begun_anew, remember
from sources import Source, detector_of, read_source

from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame
from objreg_ros.geometry import pose_error
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.truth import FALSE, Truth, within

WITHIN_S = 5.0
QUICK = {"frames": 160, "starts": 1}


def wake(
    frames: Sequence[Frame], store: Path, earlier: Earlier, truth: Truth, params: RegistrarParams
) -> dict[str, Any]:
    """What a later session answers, frame by frame; it ends `WITHIN_S` after it was relocated."""
    row: dict[str, Any] = {
        "seen_s": None,
        "after_s": None,
        "first": None,
        "answers": 0,
        "drifted": 0,
        "worst": [0.0, 0.0],
        "closures": [],
    }
    began_ns, seen_ns, known_ns, last = frames[0].stamp_ns, None, None, 0
    with closing(Registrar(params.replaced(store=str(store)))) as registrar:
        for frame in begun_anew(frames):
            last = frame.stamp_ns - LATER_NS
            closures = registrar.process(frame).closures
            row["closures"] += [begun_summary(one, truth) for one in closures if one.from_session != one.to_session]
            T = truth.at(last)
            if T is None:
                continue
            if seen_ns is None and earlier.knows(replace(frame, stamp_ns=last), T):
                seen_ns, row["seen_s"] = last, round(1e-9 * (last - began_ns), 2)
            found = registrar.relocalised
            if found is not None and found.stamp_ns == frame.stamp_ns:
                if known_ns is None:
                    known_ns = last
                _judge(row, pose_error(found.T_map_camera, earlier.T_map_camera(T, found.target_ns)))
            if known_ns is not None and last - known_ns > 1e9 * WITHIN_S:
                break
    if known_ns is not None:
        row["after_s"] = round(1e-9 * (known_ns - (known_ns if seen_ns is None else seen_ns)), 2)
    row["counts"] = known_ns is not None or (seen_ns is not None and last - seen_ns >= 1e9 * WITHIN_S)
    return row


def begun_summary(closure: LoopClosure, truth: Truth) -> dict[str, Any]:
    """What a closure to the earlier session says of itself, and its true error in degrees and centimetres."""
    evidence = {name: round(closure.evidence[name], 2) for name in ("odds", "agreeing") if name in closure.evidence}
    return evidence | {"error": truth.error(replace(closure, to_ns=closure.to_ns - LATER_NS))}


def _judge(row: dict[str, Any], error: tuple[float, float]) -> None:
    row["first"] = row["first"] or [round(part, 2) for part in error]
    row["answers"] += 1
    row["drifted"] += not within(error, FALSE)
    row["worst"] = [round(max(a, b), 2) for a, b in zip(row["worst"], error, strict=True)]


def measure(frames: list[Frame], truth: Truth, params: RegistrarParams, starts: int) -> list[dict[str, Any]]:
    """The later sessions of a recording."""
    half = len(frames) // 2
    earlier, rows = Earlier.of(frames[:half], truth), []
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "earlier.db"
        remember(store, frames[:half], params)
        for k in range(starts):
            begin = half + k * (len(frames) - half) // starts
            copy = Path(shutil.copy(store, Path(folder) / f"later_{k}.db"))
            rows.append({"begins_s": round(1e-9 * (frames[begin].stamp_ns - frames[0].stamp_ns), 1)})
            rows[-1] |= wake(frames[begin:], copy, earlier, truth, params)
    return rows


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Of starts that saw a known object for long enough: the share that was relocated in time; false ones of all."""
    could = [row for row in rows if row["counts"]]
    times = [row["after_s"] for row in could if row["after_s"] is not None]
    in_time = sum(seconds <= WITHIN_S for seconds in times)
    return {
        "sessions": len(rows),
        "could": len(could),
        "in_time": in_time,
        "share": round(in_time / max(len(could), 1), 3),
        "median_s": round(float(np.median(times)), 2) if times else None,
        "false_sessions": sum(row["first"] is not None and not within(tuple(row["first"]), FALSE) for row in rows),
        "drifted": sum(row["drifted"] for row in rows),
        "answers": sum(row["answers"] for row in rows),
    }


def line(name: str, figures: dict[str, Any]) -> str:
    """A row of the table."""
    share = f"{figures['in_time']}/{figures['could']} = {figures['share']:.3f}"
    median = "-" if figures["median_s"] is None else f"{figures['median_s']:.2f}"
    counts = f"{figures['false_sessions']:>6} {figures['answers']:>8} {figures['drifted']:>8}"
    return f"{name:28} {figures['sessions']:>8} {share:>16} {median:>9} {counts}"


HEAD = f"{'recording':28} {'sessions':>8} {'within 5 s':>16} {'median s':>9} {'false':>6} {'answers':>8} {'drifted':>8}"


class Asked(NamedTuple):
    """What is measured: the rows of a recording, their summary, and a row of the table with its head."""

    head: str
    rows: Callable[[Source, RegistrarParams], list[dict[str, Any]]]
    summary: Callable[[Sequence[dict[str, Any]]], dict[str, Any]]
    line: Callable[[str, dict[str, Any]], str]


def asked_of(by_days: bool, starts: int) -> Asked:
    """Whether keyframes of the second half are judged, or ``starts`` in it."""
    if by_days:
        return Asked(days.HEAD, lambda source, params: days.measure(source.frames, source.truth, params), *days.TABLE)
    return Asked(HEAD, lambda source, params: measure(source.frames, source.truth, params, starts), summary, line)


@click.command(help=__doc__)
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option("--simulate", "scenarios", multiple=True, metavar="SCENARIO:SEED,SEED…", help="Simulate these, use them.")
@click.option("--frames", default=600, show_default=True, help="Frames of a simulated recording.")
@click.option("--starts", default=4, show_default=True, type=click.IntRange(min=1), help="Later sessions of each.")
@click.option("--days", "by_days", is_flag=True, help="Judge every keyframe of the second half: the next day.")
@click.option("--model", default="", help="ONNX model; `truth`: a simulation's boxes.")
@click.option("--threshold", default=0.5, show_default=True, help="Least score of a detection; COCO models want 0.4.")
@click.option("--seed", default=1, show_default=True, help="Seed of the synthetic drift and of the registrar.")
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option(
    "--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/closure"), show_default=True
)
@click.option("--quick", is_flag=True, help="One start, and one short loop without RECORDINGS.")
@click.pass_context
def main(
    context: click.Context, recordings: tuple[Path, ...], out: Path | None, keep: Path, quick: bool, **options: Any
) -> None:
    """Measure and print; the figures are written after every recording."""
    options |= quick_values(context, quick, QUICK if recordings else QUICK | {"scenarios": ("loop:0",)})
    cv2.setNumThreads(1)
    paths = paths_of(recordings, plans(options["scenarios"]), options["frames"], keep)
    rows: dict[str, list[dict[str, Any]]] = {}
    asked = asked_of(options["by_days"], options["starts"])
    click.echo(asked.head)
    for make in paths:
        path = make()
        with read_source(path, detector_of(options["model"], options["threshold"]), options["seed"]) as source:
            params = RegistrarParams(seed=options["seed"]).replaced(**source.camera)
            rows[path.name] = asked.rows(source, params)
        click.echo(asked.line(path.name, asked.summary(rows[path.name])))
        if out is not None:
            total = asked.summary([row for of in rows.values() for row in of])
            out.write_text(json.dumps({"total": total, "recordings": rows}, indent=1) + "\n", encoding="utf-8")
    click.echo(asked.line("all", asked.summary([row for of in rows.values() for row in of])))


if __name__ == "__main__":
    main()
