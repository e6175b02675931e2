# SPDX-License-Identifier: Apache-2.0
"""Are two equal places taken for one another? Twin places that differ in one poster, one book or one chair's place.

A recording of the scenario `twins` visits both places twice. Its first half is the map. Each later visit is a session
of its own, in odometry that begins anew. Four figures come of it:

* forced: keyframes of one place against those of its twin that were taken from nearest by, through the gate alone and
  through the search, which knows the map. ``false`` are those that are published.
* sessions: constraints to the right place and to its twin, keyframes that are said to fit both, and whether the
  session ends with the right place known, of those that saw what differs (within REACH_M of it, in its picture).
* twin not stored: the same where the map is the first visit alone and the session is in the other place. That visit
  ends with a look through the opening, so something of the other place is stored, and it is no clean measure.

    python benchmarks/twins.py --quick
    python benchmarks/twins.py --seeds 100,101,102 --json OUT
    python benchmarks/twins.py --seeds 100,101,102 --alone        as if twins were not looked for
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from closure import simulated
from command_line import quick_values
from rooms import keyframes_of
from sessions import LATER_NS, begun_anew, remember
from sources import detector_of, read_source

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Reason
from objreg_ros.data.frames import Frame, View
from objreg_ros.data.localisation import State
from objreg_ros.geometry import inverse, pose_error
from objreg_ros.memory.landmarks import Landmarks
from objreg_ros.memory.retrieval import CandidateKeyframe, Index
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.candidate_search import Budget, Means, Search
from objreg_ros.registrar.confirmation import Confirmation
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registrar.relocalisation import Relocalisation
from objreg_ros.registrar.rivalry import Rivalry
from objreg_ros.registrar.thinning import Thinning
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration import gate_of, method_of
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.simulation.scenarios import twins_of
from objreg_tools.simulation.world.twins import T_SECOND_FIRST, Twins
from objreg_tools.truth import FALSE, Truth, within

REACH_M = {"poster": 3.5, "book": 1.6, "chair": 3.0}  # from where what differs is large enough in a view
NEAR = 30.0, 1.0  # degrees and m between the poses of keyframes of either place, brought upon each other
MARGIN = 0.05  # of the picture
QUICK = {"seeds": "0", "frames": 120, "tries": 10}
ENDLESS = Budget(float("inf"), lambda: False)


def visits(frames: Sequence[Frame], truth: Truth) -> list[list[Frame]]:
    """The frames by the place that they are in, one visit after the other; those without truth left out."""
    known = [frame for frame in frames if truth.at(frame.stamp_ns) is not None]
    return [list(one) for _, one in groupby(known, lambda frame: place_of(truth, frame.stamp_ns))]


def place_of(truth: Truth, stamp_ns: int) -> int:
    """The place of the camera, 0 or 1."""
    T = truth.at(stamp_ns)
    assert T is not None
    return int(T[0, 3] > 0.0)


def shows(view: View, T_world_camera: Array, twins: Twins, place: int) -> bool:
    """Whether what differs is in a view, where it is or where it would be if the places were equal."""
    spots = np.array([twins.spots[place], twins.empty_spots[place]])
    x, y, z = (spots @ inverse(T_world_camera)[:3, :3].T + inverse(T_world_camera)[:3, 3]).T
    k, ahead = view.intrinsics, z > 0.3
    u, v = k.fx * x / np.where(ahead, z, 1.0) + k.cx, k.fy * y / np.where(ahead, z, 1.0) + k.cy
    inside = (np.abs(u / k.width - 0.5) < 0.5 - MARGIN) & (np.abs(v / k.height - 0.5) < 0.5 - MARGIN)
    return bool((ahead & inside & (z < REACH_M[twins.kind])).any())


def sessions(
    later: Sequence[Sequence[Frame]], store: Path, truth: Truth, twins: Twins, params: RegistrarParams
) -> list[dict[str, Any]]:
    """What becomes of each later visit, beside a copy of the map."""
    with tempfile.TemporaryDirectory() as folder:
        copies = [str(shutil.copy(store, Path(folder) / f"{k}.db")) for k in range(len(later))]
        return [
            visit(frames, truth, twins, params.replaced(store=copy)) for frames, copy in zip(later, copies, strict=True)
        ]


def visit(frames: Sequence[Frame], truth: Truth, twins: Twins, params: RegistrarParams) -> dict[str, Any]:
    """What becomes of one visit."""
    place, seen, alike, refused = place_of(truth, frames[0].stamp_ns), 0, 0, 0
    closures: list[LoopClosure] = []
    views = {frame.stamp_ns: frame.view for frame in frames}
    with closing(Registrar(params)) as registrar:
        for outcome in outcomes(registrar, frames):
            closures += [one for one in outcome.closures if one.from_session != one.to_session]
            refused += sum(one.reason is Reason.ALIKE for one in outcome.rejected)
            if outcome.keyframe_ns is not None:
                state = registrar.localisation
                alike += state is not None and state.state is State.AMBIGUOUS
                stamp_ns = outcome.keyframe_ns - LATER_NS
                T = truth.at(stamp_ns)
                seen += T is not None and stamp_ns in views and shows(views[stamp_ns], T, twins, place)
    wrong = [one for one in closures if not is_right(one, truth)]
    last = max(closures, key=lambda one: one.to_ns, default=None)
    return {
        "place": place,
        "seen": int(seen),
        "constraints": len(closures),
        "false": len(wrong),
        "alike": int(alike),
        "refused_as_alike": int(refused),
        "known": last is not None and last not in wrong,
    }


def outcomes(registrar: Registrar, frames: Sequence[Frame]) -> Iterator[Outcome]:
    """Those of each frame and of the end, as they come."""
    yield from (registrar.process(frame) for frame in begun_anew(list(frames)))
    yield registrar.finish()


def is_right(closure: LoopClosure, truth: Truth) -> bool:
    """Whether a constraint of a later session is no false one."""
    error = truth.error(replace(closure, to_ns=closure.to_ns - LATER_NS))
    return error is not None and within(error, FALSE)


def forced(
    later: Sequence[Keyframe], store: Path, truth: Truth, params: RegistrarParams, tries: int, alone: bool
) -> dict[str, int]:
    """Keyframes against those of the twin from nearest by, ``tries`` in all; each with the map's own candidates."""
    once = params.replaced(closures=1, candidates=1, confirm_seconds=0.0)
    done = {"tried": 0, "accepted": 0, "false": 0, "alike": 0}
    with closing(Store(store, read_only=True)) as stored, ThreadPoolExecutor(1) as pool:
        known = [stored.keyframe(number) for number in stored.keyframe_ids()]
        index, landmarks = Index(once), Landmarks(once)
        index.add_objects(landmarks.passing(stored.sightings()))
        method, gate = method_of(once), gate_of(once)
        for keyframe, twin in spaced(pairs_of(later, known, truth), tries):
            natural = index.query(sightings_of(keyframe))
            first = CandidateKeyframe(twin.keyframe_id, twin.session, twin.stamp_ns, natural[0].votes if natural else 1)
            for rule in [None] if alone else [None, Rivalry(Relocalisation())]:
                means = Means(stored, method, gate, Confirmation(once), pool, Vetoes(), rule)
                rest = [one for one in natural if one.keyframe_id != twin.keyframe_id]
                found = Search(keyframe, Thinning(once.thin_seconds), ENDLESS, means, once).run([first, *rest])
                if rule is None:
                    done["tried"] += 1
                    done["accepted"] += len(found.accepted)
                    if not found.accepted:
                        break
                else:
                    done["false"] += any(one.target.keyframe_id == twin.keyframe_id for one in found.accepted)
                    done["alike"] += bool(found.alike)
    if alone:
        done["false"] = done["accepted"]
    return done


def pairs_of(later: Sequence[Keyframe], known: Sequence[Keyframe], truth: Truth) -> list[tuple[Keyframe, Keyframe]]:
    """Keyframes with those of the twin whose camera stood alike."""
    found = []
    for one in later:
        place, T = place_of(truth, one.stamp_ns - LATER_NS), truth.at(one.stamp_ns - LATER_NS)
        for other in known:
            T_other = truth.at(other.stamp_ns)
            assert T is not None and T_other is not None
            if place_of(truth, other.stamp_ns) != place:
                degrees, centimetres = pose_error(T_SECOND_FIRST @ T_other, T)
                if degrees < NEAR[0] and centimetres < 100 * NEAR[1]:
                    found.append((one, other))
    return found


def spaced(pairs: Sequence[Any], count: int) -> list[Any]:
    """So many of all, evenly."""
    return [pairs[k] for k in np.unique(np.linspace(0, len(pairs) - 1, min(count, len(pairs))).astype(int))]


def measure(
    frames: Sequence[Frame], truth: Truth, camera: dict[str, float], seed: int, tries: int, alone: bool
) -> dict[str, Any]:
    """The figures of one recording."""
    params, twins = RegistrarParams(seed=seed, threads=1).replaced(**camera), twins_of(seed)
    passes = visits(frames, truth)
    before, later = [*passes[0], *passes[1]], passes[2:]
    with tempfile.TemporaryDirectory() as folder:
        both, one = Path(folder) / "both.db", Path(folder) / "one.db"
        remember(both, before, params)
        remember(one, passes[0], params)
        moved = [keyframes_of(begun_anew(frames), params, 7, 10_000) for frames in later]
        return {
            "kind": twins.kind,
            "forced": forced([k for keyframes in moved for k in keyframes], both, truth, params, tries, alone),
            "sessions": sessions(later, both, truth, twins, params),
            "not_stored": sessions(later[1:], one, truth, twins, params),
        }


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """All recordings together."""
    of = {key: sum(row["forced"][key] for row in rows) for key in ("tried", "accepted", "false", "alike")}
    every = [one for row in rows for one in row["sessions"]]
    saw = [one for one in every if one["seen"]]
    return {
        "forced": of,
        "sessions": len(every),
        "constraints": sum(one["constraints"] for one in every),
        "false": sum(one["false"] for one in every),
        "alike": sum(one["alike"] for one in every),
        "saw": len(saw),
        "known": sum(one["known"] for one in saw),
        "not_stored_constraints": sum(one["constraints"] for row in rows for one in row["not_stored"]),
        "not_stored_false": sum(one["false"] for row in rows for one in row["not_stored"]),
    }


def line(name: str, of: dict[str, Any]) -> str:
    """A row of the table."""
    tries = of["forced"]
    return (
        f"{name:16} {tries['tried']:>6} {tries['accepted']:>8} {tries['false']:>6} {of['sessions']:>9} "
        f"{of['constraints']:>12} {of['false']:>6} {of['alike']:>6} {of['known']:>6}/{of['saw']:<5} "
        f"{of['not_stored_constraints']:>10} {of['not_stored_false']:>6}"
    )


HEAD = (
    f"{'recording':16} {'forced':>6} {'by gate':>8} {'false':>6} {'sessions':>9} {'constraints':>12} {'false':>6} "
    f"{'alike':>6} {'known/saw':>12} {'not stored':>10} {'false':>6}"
)


def without_rivals() -> None:
    """Look for no twins, in this process."""
    Search._without_rivals = lambda self, found, *_: found  # type: ignore[method-assign,assignment]


@click.command(help=__doc__)
@click.option("--seeds", default="100,101,102", show_default=True, help="Of the scenario, by commas.")
@click.option("--frames", default=240, show_default=True, help="Frames of a recording.")
@click.option("--tries", default=100, show_default=True, help="Forced tries of a recording.")
@click.option("--alone", is_flag=True, help="Each pair by itself: twins are not looked for.")
@click.option("--model", default="truth", show_default=True, help="ONNX model; `truth`: a simulation's boxes.")
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/twins"), show_default=True)
@click.option("--quick", is_flag=True, help="One short recording and few tries.")
@click.pass_context
def main(context: click.Context, out: Path | None, keep: Path, quick: bool, **options: Any) -> None:
    """Measure and print; the figures are written after every recording."""
    options |= quick_values(context, quick, QUICK)
    cv2.setNumThreads(1)
    keep.mkdir(parents=True, exist_ok=True)
    if options["alone"]:
        without_rivals()
    rows: dict[str, dict[str, Any]] = {}
    click.echo(HEAD)
    for seed in map(int, options["seeds"].split(",")):
        path = simulated(keep, "twins", seed, options["frames"])
        with read_source(path, detector_of(options["model"]), seed) as source:
            rows[path.name] = measure(
                source.frames, source.truth, source.camera, seed, options["tries"], options["alone"]
            )
        click.echo(line(f"{path.name} {rows[path.name]['kind']}", summary([rows[path.name]])))
        if out is not None:
            figures = {"total": summary(list(rows.values())), "recordings": rows}
            out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    click.echo(line("all of them", summary(list(rows.values()))))


if __name__ == "__main__":
    main()
