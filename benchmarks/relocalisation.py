# SPDX-License-Identifier: Apache-2.0
"""Does it know where it woke up? Sessions of one place: an earlier one in the store, later ones begun anywhere.

The first half of a recording is the earlier session. The later sessions begin at several moments of its second half,
each beside a copy of the store, in odometry that begins anew at the camera. A known object is seen once one that the
earlier session stored is (by label and true place, within 30 cm). Told is the share of starts that saw one for five
seconds and were relocated by then, the time that it took, and false starts: a first answer that is worse than 8 degrees
or 15 cm (FALSE) in the earlier session's odometry, as that was at the keyframe that the answer is by. For where
that session passed a place twice, its drift gives the place two positions in its map. Later answers are judged alike
and counted apart as drifted: between two closures both sessions' odometry drifts, as the covariance of an answer says.

    python benchmarks/relocalisation.py --quick
    python benchmarks/relocalisation.py --simulate moved:0,1,2,3,4 --simulate loop:0,1,2,3,4 --starts 4 --json OUT
    python benchmarks/relocalisation.py REC --threshold 0.4 --starts 6
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from closure import plans, simulated
from command_line import quick_values
from sources import detector_of, read_source

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import UNNAMED, Frame
from objreg_ros.geometry import inverse, pose_error, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registration.keyframe import bounding_box
from objreg_tools.truth import FALSE, Truth, within

WITHIN_S = 5.0
NEAR_M = 0.3  # an object that is known stands no farther from where it stood
LATER_NS = 10**15  # the later sessions' clock goes on long after the earlier one
QUICK = {"frames": 160, "starts": 1}


@dataclass
class Earlier:
    """What the earlier session knew: where the world was in its odometry, moment by moment, and its objects in it."""

    stamps_ns: list[int]
    T_odom_world: list[Array]
    objects: list[tuple[str, Array]]

    @classmethod
    def of(cls, frames: Iterable[Frame], truth: Truth) -> Earlier:
        """Of the frames of the earlier session."""
        made = cls([], [], [])
        for frame in frames:
            T = truth.at(frame.stamp_ns)
            if T is not None and frame.T_odom_camera is not None:
                made.stamps_ns.append(frame.stamp_ns)
                made.T_odom_world.append(frame.T_odom_camera @ inverse(T))
                made.objects += objects_of(frame, T)
        return made

    def knows(self, frame: Frame, T_world_camera: Array) -> bool:
        """Whether a frame shows an object where it was before."""
        seen = objects_of(frame, T_world_camera)
        return any(
            label == name and np.linalg.norm(xyz - at) < NEAR_M for label, xyz in seen for name, at in self.objects
        )

    def T_map_camera(self, T_world_camera: Array, beside_ns: int) -> Array:
        """Where a true pose (4, 4) is in its map, by its odometry at a moment of its own."""
        return self.T_odom_world[int(np.argmin(np.abs(np.array(self.stamps_ns) - beside_ns)))] @ T_world_camera


def objects_of(frame: Frame, T_world_camera: Array) -> list[tuple[str, Array]]:
    """The label and the true middle (3,) of each object with a name."""
    named = [cloud for cloud in frame.objects if cloud.label != UNNAMED and len(cloud)]
    return [(cloud.label, transform(T_world_camera, bounding_box(cloud.xyz)[0])) for cloud in named]


def begun_anew(frames: Sequence[Frame]) -> list[Frame]:
    """The frames long after, in odometry that begins where the first camera stands, turned about its z axis only."""
    first = next(frame.T_odom_camera for frame in frames if frame.T_odom_camera is not None)
    yaw = np.arctan2(first[1, 2], first[0, 2])  # of the line of sight
    T = np.eye(4)
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    T[:3, 3] = first[:3, 3]
    back = inverse(T)
    return [
        replace(
            frame,
            stamp_ns=frame.stamp_ns + LATER_NS,
            T_odom_camera=None if frame.T_odom_camera is None else back @ frame.T_odom_camera,
        )
        for frame in frames
    ]


def remember(store: Path, frames: Iterable[Frame], params: RegistrarParams) -> None:
    """Make the store of the earlier session, with its closures."""
    with closing(Registrar(params.replaced(store=str(store)))) as registrar:
        for frame in frames:
            registrar.process(frame)
        registrar.finish()


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


def line(name: str, told: dict[str, Any]) -> str:
    """A row of the table."""
    share = f"{told['in_time']}/{told['could']} = {told['share']:.3f}"
    median = "-" if told["median_s"] is None else f"{told['median_s']:.2f}"
    counts = f"{told['false_sessions']:>6} {told['answers']:>8} {told['drifted']:>8}"
    return f"{name:28} {told['sessions']:>8} {share:>16} {median:>9} {counts}"


HEAD = f"{'recording':28} {'sessions':>8} {'within 5 s':>16} {'median s':>9} {'false':>6} {'answers':>8} {'drifted':>8}"


@click.command(help=__doc__)
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option("--simulate", "scenarios", multiple=True, metavar="SCENARIO:SEED,SEED…", help="Simulate these, use them.")
@click.option("--frames", default=600, show_default=True, help="Frames of a simulated recording.")
@click.option("--starts", default=4, show_default=True, type=click.IntRange(min=1), help="Later sessions of each.")
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
    told = plans(options["scenarios"])
    if not recordings and not told:
        raise click.UsageError("expected RECORDINGS or --simulate SCENARIO:SEED, got neither")
    cv2.setNumThreads(1)
    paths = [partial(Path, path) for path in recordings]
    paths += [partial(simulated, keep, *plan, options["frames"]) for plan in told]
    rows: dict[str, list[dict[str, Any]]] = {}
    click.echo(HEAD)
    for make in paths:
        path = make()
        with read_source(path, detector_of(options["model"], options["threshold"]), options["seed"]) as source:
            params = RegistrarParams(seed=options["seed"]).replaced(**source.camera)
            rows[path.name] = measure(source.frames, source.truth, params, options["starts"])
        click.echo(line(path.name, summary(rows[path.name])))
        if out is not None:
            total = summary([row for of in rows.values() for row in of])
            out.write_text(json.dumps({"total": total, "recordings": rows}, indent=1) + "\n", encoding="utf-8")
    click.echo(line("all", summary([row for of in rows.values() for row in of])))


if __name__ == "__main__":
    main()
