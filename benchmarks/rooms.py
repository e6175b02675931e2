# SPDX-License-Identifier: Apache-2.0
"""Is the right place found among many rooms? Recordings beside a store full of other rooms, and beside an empty one.

``found``: of the keyframes that could close the share in which one of the first candidates (as many as are tried) is
right. A keyframe could close when a stored one of the same recording, that odometry does not leave out as too near in
time, truly shows one of its objects at its place, and their views overlap. ``restarted``: the same if the second half
is another session, and only places of the first are right. ``constraints``, those that are loosely true
(5 degrees, 10 cm) and false ones (worse than 8 degrees or 15 cm, or with another room): what the registrar makes of it.

    python benchmarks/rooms.py --simulate loop:61000,61001 --json OUT
    python benchmarks/rooms.py REC --model MODEL --threshold 0.4 --retrieval-only

The rooms are simulated, detected by the same model, and kept in a folder for another run. A recording must not be one
of them. Their moments lie before those of every recording, since a store is asked only about what its clock has not
seen.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import click
import cv2
import numpy as np
from closure import code, plans, simulated
from command_line import quick_values
from frame_pairs import Truths
from sources import detector_of, read_source
from tqdm import tqdm

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame
from objreg_ros.detector.params import DetectorParams
from objreg_ros.keyframes.frame_window import SessionNumbers
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import Keyframer
from objreg_ros.memory.retrieval import Index
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.report.run.revisits import SeenPlace, overlap
from objreg_tools.simulation.write import simulate
from objreg_tools.truth import FALSE, LOOSE, Truth, within

FIRST_ROOM = 60_000  # the seed of the first of the other rooms
FRAMES, RATE_HZ = 40, 5.0  # of a room: a frame a view
ROOM_NS, LATER_NS = 10**12, 10**15  # rooms are so far apart in time, and recordings so much later
LEAST_OVERLAP = 0.25  # of the views of a keyframe and of the stored one that is right
ACCEPTED_EACH = 3  # so many right tries between sessions until one is accepted, where nothing is registered
QUICK = {"rooms": 3, "frames": 80}


class Taken(Protocol):
    """A recording: frames with odometry, and its truth."""

    frames: list[Frame]
    truth: Truth
    camera: dict[str, float]


class Found(NamedTuple):
    """How many keyframes there were, could close, and had a right candidate among those tried; ms of a query."""

    keyframes: int
    could_close: int
    found: int
    query_ms: float


def moved_to(frames: Iterable[Frame], shift_ns: int) -> list[Frame]:
    """The frames at another time."""
    return [replace(frame, stamp_ns=frame.stamp_ns + shift_ns) for frame in frames]


def room_recording(folder: Path, seed: int) -> Path:
    """The recording of another room, simulated if it is not there yet."""
    path = folder / f"loop_{seed}_{FRAMES}" / f"loop_{seed}"
    if not path.exists():
        unfinished = path.with_name("part")
        shutil.rmtree(unfinished, ignore_errors=True)
        simulate(unfinished, "loop", seed, FRAMES, RATE_HZ, jpeg=True, threads=len(os.sched_getaffinity(0)))
        os.replace(unfinished, path)
    return path


def store_of_rooms(folder: Path, rooms: int, detector: DetectorParams) -> Path:
    """A store with the keyframes of so many rooms, each a session; made if this code has not made it yet."""
    path = folder / f"rooms_{rooms}_{Path(detector.model).stem or 'default'}_{detector.threshold:g}_{code()}.db"
    if path.exists():
        return path
    unfinished = path.with_suffix(".part")
    for left in folder.glob(f"{unfinished.name}*"):
        left.unlink()
    for k in tqdm(range(rooms), desc="rooms"):
        with read_source(room_recording(folder, FIRST_ROOM + k), detector, k) as source:
            frames = source.frames
        if frames:
            remember(unfinished, moved_to(frames, (k + 1) * ROOM_NS - frames[0].stamp_ns))
    os.replace(unfinished, path)
    return path


def remember(store: Path, frames: Iterable[Frame]) -> None:
    """Store the keyframes of a room, and search for nothing."""
    with closing(Registrar(RegistrarParams(store=str(store)))) as registrar:
        windows = [registrar.track(frame) for frame in frames]
        for window in (*windows, *registrar.end_windows()):
            if window is not None:
                registrar.search(window, seconds=0.0)


def keyframes_of(frames: Iterable[Frame], params: RegistrarParams, session: int, first_id: int) -> list[Keyframe]:
    """The keyframes that the registrar makes of a recording, numbered."""
    keyframer = Keyframer(params, SessionNumbers(session))
    windows = [*(keyframer.add_frame(frame) for frame in frames), keyframer.finish_window()]
    made = [fuse(window, params) for window in windows if window is not None]
    return [keyframe.numbered(first_id + k) for k, keyframe in enumerate(made)]


def right_of(keyframes: Sequence[Keyframe], truth: Truth, params: RegistrarParams) -> Array:
    """(N, N) bool: whether the later keyframe (row) could close with the earlier one (column), by truth."""
    poses = [truth.at(keyframe.stamp_ns - LATER_NS) for keyframe in keyframes]
    known = [k for k, T in enumerate(poses) if T is not None]
    right = np.zeros((len(keyframes), len(keyframes)), bool)
    truths = Truths([keyframes[k] for k in known], [poses[k] for k in known], params)  # type: ignore[misc]
    seen = [SeenPlace(keyframes[k].stamp_ns, keyframes[k].view, poses[k]) for k in known]  # type: ignore[arg-type]
    for j, i in combinations(range(len(known)), 2):
        pair = truths.pair(i, j)
        if pair is not None and pair.could_close:
            right[known[i], known[j]] = overlap(seen[i], seen[j]) >= LEAST_OVERLAP
    return right


def retrieve(taken: Taken, params: RegistrarParams, others: Sequence[Sighting]) -> tuple[Found, Found]:
    """How often a right place is among the tries, in one session and restarted: nothing is registered."""
    session = 1 + max((sighting.session for sighting in others), default=-1)
    first_id = 1 + max((sighting.keyframe_id for sighting in others), default=0)
    keyframes = keyframes_of(moved_to(taken.frames, LATER_NS), params, session, first_id)
    right = right_of(keyframes, taken.truth, params)
    return found_among(keyframes, right, params, others), found_among(*restarted(keyframes, right), params, others)


def restarted(keyframes: Sequence[Keyframe], right: Array) -> tuple[list[Keyframe], Array]:
    """The keyframes, the second half in the next session, and which of those could close with which of the first."""
    half = len(keyframes) // 2
    later = [replace(keyframe, session=keyframe.session + 1) for keyframe in keyframes[half:]]
    across = np.zeros_like(right)
    across[half:, :half] = right[half:, :half]
    return [*keyframes[:half], *later], across


def found_among(
    keyframes: Sequence[Keyframe], right: Array, params: RegistrarParams, others: Sequence[Sighting]
) -> Found:
    """The same for keyframes of which is known which could close with which."""
    index, hits, seconds = Index(params), 0, 0.0
    index.add_objects(others)
    for k, keyframe in enumerate(keyframes):
        sightings = sightings_of(keyframe)
        began = time.process_time()
        candidates = index.query(sightings)[: params.candidates]
        seconds += time.process_time() - began
        rows = [candidate.keyframe_id - keyframes[0].keyframe_id for candidate in candidates]
        found = [keyframes[row].session for row in rows if row >= 0 and right[k, row]]
        index.add_objects(sightings)
        hits += bool(found)
        if found and hits % ACCEPTED_EACH == 0:
            index.meet(keyframe.session, found[0])
    return Found(len(keyframes), int(right.any(axis=1).sum()), hits, 1e3 * seconds / max(len(keyframes), 1))


def close_loops(taken: Taken, params: RegistrarParams) -> dict[str, int]:
    """What the registrar makes of a recording beside what is in its store."""
    closures: list[LoopClosure] = []
    with closing(Registrar(params)) as registrar:
        for frame in moved_to(taken.frames, LATER_NS):
            closures += registrar.process(frame).closures
        closures += registrar.finish().closures
    here = [c for c in closures if min(c.from_ns, c.to_ns) >= LATER_NS]
    errors = taken.truth.errors(replace(c, from_ns=c.from_ns - LATER_NS, to_ns=c.to_ns - LATER_NS) for c in here)
    return {
        "constraints": len(closures),
        "true": sum(within(error, LOOSE) for error in errors),
        "false": sum(not within(error, FALSE) for error in errors) + len(closures) - len(here),
        "with_other_rooms": len(closures) - len(here),
    }


def measure(taken: Taken, store: Path | None, seed: int, register: bool) -> dict[str, Any]:
    """The figures of a recording beside a store, none for an empty one."""
    params = RegistrarParams(seed=seed).replaced(**taken.camera)
    others: list[Sighting] = []
    if store is not None:
        with closing(Store(store, read_only=True)) as stored:
            others = list(stored.sightings())
    found, anew = retrieve(taken, params, others)
    row: dict[str, Any] = {**found._asdict(), "share": share(found)}
    row["restarted"] = {**anew._asdict(), "share": share(anew)}
    if register:
        with tempfile.TemporaryDirectory() as folder:
            copy = "" if store is None else str(shutil.copy(store, folder))
            row |= close_loops(taken, params.replaced(store=copy))
    return row


def share(found: Found) -> float:
    """Of the keyframes that could close those that would be tried with a right one."""
    return round(found.found / max(found.could_close, 1), 3)


def line(name: str, beside: str, row: dict[str, Any]) -> str:
    """A row of the table."""
    parts = row, row["restarted"]
    of = " ".join(f"{part['found']}/{part['could_close']} = {part['share']:.3f}".rjust(16) for part in parts)
    made = [f"{row[key]:>6}" for key in ("constraints", "true", "false") if key in row]
    return f"{name:24} {beside:>9} {row['keyframes']:>9} {of} {row['query_ms']:>9.2f} {' '.join(made)}"


HEAD = (
    f"{'recording':24} {'beside':>9} {'keyframes':>9} {'found':>16} {'restarted':>16} {'query ms':>9} "
    "constr   true  false"
)


@click.command(help=__doc__)
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option("--simulate", "scenarios", multiple=True, metavar="SCENARIO:SEED,SEED…", help="Simulate these, use them.")
@click.option("--rooms", default=50, show_default=True, type=click.IntRange(min=1), help="Other rooms in the store.")
@click.option("--frames", default=200, show_default=True, help="Frames of a simulated recording.")
@click.option("--model", default="", help="ONNX model that detects in recordings and rooms.")
@click.option("--threshold", default=0.5, show_default=True, help="Least score of a detection; COCO models want 0.4.")
@click.option("--seed", default=1, show_default=True, help="Seed of the synthetic drift and of the registrar.")
@click.option("--retrieval-only", is_flag=True, help="Register nothing: seconds instead of minutes.")
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/rooms"), show_default=True)
@click.option("--quick", is_flag=True, help="Three rooms, and one short loop without RECORDINGS.")
@click.pass_context
def main(
    context: click.Context,
    recordings: tuple[Path, ...],
    out: Path | None,
    keep: Path,
    retrieval_only: bool,
    quick: bool,
    **options: Any,
) -> None:
    """Measure and print."""
    options |= quick_values(context, quick, QUICK if recordings else QUICK | {"scenarios": ("loop:61000",)})
    simulations = plans(options["scenarios"])
    if not recordings and not simulations:
        raise click.UsageError("expected RECORDINGS or --simulate SCENARIO:SEED, got neither")
    cv2.setNumThreads(1)
    keep.mkdir(parents=True, exist_ok=True)
    detector = detector_of(options["model"], options["threshold"])
    store = store_of_rooms(keep, options["rooms"], detector)
    paths = [partial(Path, path) for path in recordings]
    paths += [partial(simulated, keep, *plan, options["frames"]) for plan in simulations]
    rows: dict[str, dict[str, Any]] = {}
    click.echo(HEAD)
    for make in paths:
        path = make()
        with read_source(path, detector, options["seed"]) as source:
            for beside, full in (("none", None), (f"{options['rooms']} rooms", store)):
                row = measure(source, full, options["seed"], not retrieval_only)
                rows.setdefault(path.name, {})[beside] = row
                click.echo(line(path.name, beside, row))
    if out is not None:
        out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
