# SPDX-License-Identifier: Apache-2.0
"""Does it notice that it was taken elsewhere, and is it as sure as it says?

Kidnappings are made at random: two parts of a recording one after the other, stamps continued. Odometry carries on as
if nothing had happened, level and with its heading; the camera jumps by more than half a metre or 45 degrees. Each is
made twice: within one session, and in a later session beside the store of the recording's first half. It is found if
the state is LOST or KIDNAPPED at most three seconds after the first frame that shows two objects which were seen before
(by label and true place, within 30 cm). Those that never show two, or end before, do not count. A false alarm is a LOST
or KIDNAPPED that begins in a run without kidnapping, or before it. Where a map is tied, the probability that the pose
is within 0.5 m is compared with the truth, twice a second: against that session's map as it is around the newest
closure. `looks` counts what a view shows of known objects, of a camera that is there and of one that is elsewhere.

    python benchmarks/localisation.py --quick
    python benchmarks/localisation.py --simulate moved:1,2 --simulate loop:0 --kidnappings 6 --json OUT
    python benchmarks/localisation.py KITCHEN --model COCO --threshold 0.4 --json OUT
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from closure import paths_of, plans
from command_line import quick_values
from sessions import NEAR_M, Earlier, begun_anew, objects_of, remember
from sources import detector_of, read_source

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.localisation import State
from objreg_ros.geometry import inverse, pose_error
from objreg_ros.registrar.localisation.localisation import Localisation
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.truth import Truth

WITHIN_S, WITHIN_M = 3.0, 0.5
JUMP_M, JUMP_DEG = 0.5, 45.0
LEAST_OBJECTS = 2
SAMPLE_NS = 500_000_000
BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0)
ALARMS = (State.LOST, State.KIDNAPPED)
QUICK = {"frames": 120, "kidnappings": 1}


@dataclass
class Plan:
    """The frames of a session, when the camera of each is in truth, and at which it was kidnapped, if it was."""

    frames: list[Frame]
    true_ns: list[int]
    cut: int | None = None


@dataclass
class Tally:
    """What the sessions of one recording came to."""

    kidnapped: list[dict[str, Any]] = field(default_factory=list)
    normal_s: float = 0.0
    alarms: list[str] = field(default_factory=list)
    believed: list[tuple[float, bool]] = field(default_factory=list)
    looks: Counter[str] = field(default_factory=Counter)


def level(T: Array) -> Array:
    """The pose (4, 4) of a camera without its tilt: where it is, turned as its line of sight."""
    yaw = np.arctan2(T[1, 2], T[0, 2])
    out = np.eye(4)
    out[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    out[:3, 3] = T[:3, 3]
    return out


def spliced(frames: Sequence[Frame], cut: int, other: int) -> Plan:
    """The frames to ``cut``, and those from ``other`` on as if they came next."""
    before, after = frames[cut - 1], frames[other]
    assert before.T_odom_camera is not None and after.T_odom_camera is not None
    T = level(before.T_odom_camera) @ inverse(level(after.T_odom_camera))
    later_ns = before.stamp_ns + (before.stamp_ns - frames[cut - 2].stamp_ns) - after.stamp_ns
    moved = [
        replace(one, stamp_ns=one.stamp_ns + later_ns, T_odom_camera=T @ one.T_odom_camera)
        for one in frames[other:]
        if one.T_odom_camera is not None
    ]
    true_ns = [one.stamp_ns for one in (*frames[:cut], *frames[other:])]
    return Plan([*frames[:cut], *moved], true_ns, cut)


def kidnappings(frames: Sequence[Frame], truth: Truth, most: int, rng: np.random.Generator) -> Iterator[Plan]:
    """So many at random; fewer where the camera hardly moves."""
    seconds = 1e-9 * (frames[-1].stamp_ns - frames[0].stamp_ns)
    tail = max(2, round(len(frames) * min(5.0 / seconds, 0.4)))
    made = 0
    for _ in range(100 * most):
        cut, other = int(rng.integers(len(frames) // 3, len(frames))), int(rng.integers(0, len(frames) - tail))
        poses = truth.at(frames[cut - 1].stamp_ns), truth.at(frames[other].stamp_ns)
        if poses[0] is None or poses[1] is None:
            continue
        degrees, cm = pose_error(poses[0], poses[1])
        if 0.01 * cm > JUMP_M or degrees > JUMP_DEG:
            yield spliced(frames, cut, other)
            made += 1
        if made == most:
            return


class Counted:
    """Counts what views show of known objects beside what the localisation does with it."""

    def __init__(self, tally: Tally) -> None:
        self.tally, self.where = tally, "here"

    def watch(self, here: Localisation) -> None:
        """Count what it expects from now on."""
        expect = here.expect

        def counting(*args: Any) -> Any:
            found = expect(*args)
            self.tally.looks.update(f"{self.where} {look.value}" for _, look in found)
            return found

        here.expect = counting  # type: ignore[assignment, method-assign]


def follow(plan: Plan, truth: Truth, earlier: Earlier | None, params: RegistrarParams, tally: Tally) -> None:
    """One session; its figures go to the tally."""
    known = Earlier([], [], [] if earlier is None else list(earlier.objects))
    cut_ns = None if plan.cut is None else plan.frames[plan.cut].stamp_ns
    seen_ns, found_ns, found_as, alarmed, sampled_ns = None, None, "", False, 0
    counted = Counted(tally)
    with closing(Registrar(params)) as registrar:
        for k, (frame, true_ns) in enumerate(zip(plan.frames, plan.true_ns, strict=True)):
            if k == 1:
                counted.watch(registrar._tracks.followed.localisation)
            elsewhere = cut_ns is not None and frame.stamp_ns >= cut_ns
            counted.where = "elsewhere" if elsewhere and found_ns is None else "here"
            T = truth.at(true_ns)
            if elsewhere and seen_ns is None and T is not None and _shows(frame, T, known) >= LEAST_OBJECTS:
                seen_ns = frame.stamp_ns
            registrar.process(frame)
            now = registrar.localisation
            assert now is not None
            if not elsewhere:
                if T is not None:
                    known.objects += objects_of(frame, T)
                if now.state in ALARMS and not alarmed:
                    tally.alarms.append(now.reason)
                alarmed = now.state in ALARMS
                tally.normal_s += 0.0 if k == 0 else 1e-9 * (frame.stamp_ns - plan.frames[k - 1].stamp_ns)
            elif found_ns is None and now.state in ALARMS:
                found_ns, found_as = frame.stamp_ns, f"{now.state.name}: {now.reason}"
            if earlier is not None and T is not None and frame.stamp_ns - sampled_ns >= SAMPLE_NS:
                sampled_ns = frame.stamp_ns
                _compare(registrar, earlier, T, tally)
    if cut_ns is not None:
        last_ns = plan.frames[-1].stamp_ns
        counts = seen_ns is not None and (found_ns is not None or last_ns - seen_ns >= 1e9 * WITHIN_S)
        after_s = None if found_ns is None or seen_ns is None else round(1e-9 * (found_ns - seen_ns), 2)
        in_time = counts and after_s is not None and after_s <= WITHIN_S
        row = {"kind": "alone" if earlier is None else "map", "counts": counts, "after_s": after_s, "in_time": in_time}
        tally.kidnapped.append(row | {"as": found_as})


def _shows(frame: Frame, T: Array, known: Earlier) -> int:
    """How many objects a frame shows that stand where one of their label was seen."""
    return sum(
        any(label == name and np.linalg.norm(xyz - at) < NEAR_M for name, at in known.objects)
        for label, xyz in objects_of(frame, T)
    )


def _compare(registrar: Registrar, earlier: Earlier, T_world_camera: Array, tally: Tally) -> None:
    found, now = registrar.relocalised, registrar.localisation
    if found is not None and now is not None:
        T_true = earlier.T_map_camera(T_world_camera, found.target_ns)
        error_m = float(np.linalg.norm(found.T_map_camera[:3, 3] - T_true[:3, 3]))
        tally.believed.append((now.probability, error_m <= WITHIN_M))


def measure(frames: list[Frame], truth: Truth, params: RegistrarParams, asked: int, seed: int) -> Tally:
    """The sessions of a recording."""
    tally, rng, half = Tally(), np.random.default_rng(seed), len(frames) // 2
    frames = [one for one in frames if one.T_odom_camera is not None]
    for plan in (Plan(frames, [one.stamp_ns for one in frames]), *kidnappings(frames, truth, asked, rng)):
        follow(plan, truth, None, params, tally)
    with tempfile.TemporaryDirectory() as folder:
        earlier, store = Earlier.of(frames[:half], truth), Path(folder) / "earlier.db"
        remember(store, frames[:half], params)
        later = frames[half:]
        for k, plan in enumerate(
            (Plan(later, [one.stamp_ns for one in later]), *kidnappings(later, truth, asked, rng))
        ):
            copy = Path(shutil.copy(store, Path(folder) / f"later_{k}.db"))
            anew = replace(plan, frames=begun_anew(plan.frames))
            follow(anew, truth, earlier, params.replaced(store=str(copy)), tally)
    return tally


def summary(tallies: Sequence[Tally]) -> dict[str, Any]:
    """The figures of several recordings together."""
    rows = [row for one in tallies for row in one.kidnapped if row["counts"]]
    hours = sum(one.normal_s for one in tallies) / 3600.0
    alarms = [reason for one in tallies for reason in one.alarms]
    out: dict[str, Any] = {"made": sum(len(one.kidnapped) for one in tallies), "counted": len(rows)}
    for kind in ("alone", "map"):
        of = [row for row in rows if row["kind"] == kind]
        out[kind] = {"counted": len(of), "in_time": sum(row["in_time"] for row in of)}
    out["in_time"] = sum(row["in_time"] for row in rows)
    out["share"] = round(out["in_time"] / max(len(rows), 1), 3)
    out |= {"normal_hours": round(hours, 4), "false_alarms": len(alarms)}
    out["alarms_an_hour"] = round(len(alarms) / hours, 2) if hours else None
    out["reliability"] = reliability([pair for one in tallies for pair in one.believed])
    out["looks"] = dict(sum((one.looks for one in tallies), Counter[str]()))
    return out


def reliability(believed: Sequence[tuple[float, bool]]) -> list[dict[str, float]]:
    """Of the answers in each bin of stated probability: how many, what they stated on average, how many were right."""
    table = []
    for low, high in pairwise(BINS):
        inside = [(p, right) for p, right in believed if low <= p < high or (high == 1.0 and p == 1.0)]
        if inside:
            stated, right = np.mean(inside, axis=0)
            row = {"from": low, "to": high, "answers": len(inside), "stated": round(float(stated), 3)}
            table.append(row | {"right": round(float(right), 3)})
    return table


HEAD = f"{'recording':28} {'made':>5} {'alone 3 s':>10} {'map 3 s':>10} {'share':>6} {'normal s':>9} {'alarms':>7}"


def line(name: str, found: dict[str, Any]) -> str:
    """A row of the table."""
    alone, tied = (f"{found[kind]['in_time']}/{found[kind]['counted']}" for kind in ("alone", "map"))
    seconds = 3600.0 * found["normal_hours"]
    counts = f"{found['share']:>6.2f} {seconds:>9.0f} {found['false_alarms']:>7}"
    return f"{name:28} {found['made']:>5} {alone:>10} {tied:>10} {counts}"


@click.command(help=__doc__)
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option("--simulate", "scenarios", multiple=True, metavar="SCENARIO:SEED,SEED…", help="Simulate these, use them.")
@click.option("--frames", default=600, show_default=True, help="Frames of a simulated recording.")
@click.option(
    "--kidnappings", default=4, show_default=True, type=click.IntRange(min=1), help="Of each recording, twice."
)
@click.option("--model", default="", help="ONNX model; `truth`: a simulation's boxes.")
@click.option("--threshold", default=0.5, show_default=True, help="Least score of a detection; COCO models want 0.4.")
@click.option("--seed", default=1, show_default=True, help="Seed of drift, of the registrar and of the kidnappings.")
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option(
    "--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/closure"), show_default=True
)
@click.option("--quick", is_flag=True, help="One kidnapping, and one short loop without RECORDINGS.")
@click.pass_context
def main(
    context: click.Context, recordings: tuple[Path, ...], out: Path | None, keep: Path, quick: bool, **options: Any
) -> None:
    """Measure and print; the figures are written after every recording."""
    options |= quick_values(context, quick, QUICK if recordings else QUICK | {"scenarios": ("loop:0",)})
    cv2.setNumThreads(1)
    paths = paths_of(recordings, plans(options["scenarios"]), options["frames"], keep)
    tallies: dict[str, Tally] = {}
    click.echo(HEAD)
    for make in paths:
        path = make()
        with read_source(path, detector_of(options["model"], options["threshold"]), options["seed"]) as source:
            params = RegistrarParams(seed=options["seed"], kidnapping_search=True).replaced(**source.camera)
            tallies[path.name] = measure(source.frames, source.truth, params, options["kidnappings"], options["seed"])
        click.echo(line(path.name, summary([tallies[path.name]])))
        if out is not None:
            figures = {
                name: summary([one]) | {"rows": one.kidnapped, "alarms": one.alarms} for name, one in tallies.items()
            }
            figures = {"total": summary([*tallies.values()]), "recordings": figures}
            out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    total = summary([*tallies.values()])
    click.echo(line("all", total))
    for row in total["reliability"]:
        click.echo(f"within 0.5 m stated {row['stated']:.3f}: right {row['right']:.3f} of {row['answers']}")


if __name__ == "__main__":
    main()
