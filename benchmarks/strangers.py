# SPDX-License-Identifier: Apache-2.0
"""Pairs of keyframes of different places, forced upon each other: none of them may be accepted.

Every pair is of two recordings, and shares a label: what a store of many rooms would try. A simulated room is another
place than a real one, and than one of another seed.

    python benchmarks/strangers.py KITCHEN OFFICE --model COCO --threshold 0.4 --pairs 10000 --json OUT
    python benchmarks/strangers.py KITCHEN --model COCO --simulate moved:11 --simulate opposite:12:stress
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from false_closures import Plan, plan_of
from pairs import fused
from sources import TRUE_BOXES, detector_of, read_source
from tqdm import tqdm

from objreg_ros.data.frames import Frame
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.verdict import judge
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.labels import LabelGroups
from objreg_tools.cli.commands.simulate import camera_of, sensors_of
from objreg_tools.simulation.write import simulate

PARAMS = RegistrarParams()
BLOCK = 100  # pairs that a process is given at once
_PLACES: list[list[Keyframe]] = []  # of a worker process


def keyframes_of(frames: Sequence[Frame]) -> list[Keyframe]:
    """The keyframes of a recording that have objects."""
    return [keyframe for keyframe in fused(frames, PARAMS) if keyframe.objects]


def strangers(places: Sequence[Sequence[Keyframe]], count: int, seed: int) -> list[tuple[int, int, int, int]]:
    """At most ``count`` pairs (place, keyframe, place, keyframe) that share a label, evenly over pairs of places."""
    rng, groups = np.random.default_rng(seed), LabelGroups(PARAMS.label_groups)
    labels = [[{groups.of(label) for label in keyframe.labels} for keyframe in place] for place in places]
    drawn: list[tuple[int, int, int, int]] = []
    among = list(combinations(range(len(places)), 2))
    for a, b in among:
        alike = [(i, j) for i, one in enumerate(labels[a]) for j, other in enumerate(labels[b]) if one & other]
        chosen = rng.permutation(len(alike))[: -(-count // len(among))]
        drawn += [(a, alike[k][0], b, alike[k][1]) for k in chosen]
    return sorted(drawn)[:count]


def tried(pairs: Sequence[tuple[int, int, int, int]]) -> list[tuple[str, float]]:
    """What the gate says of each pair, ``accepted`` or the reason, and the view score of the best pose."""
    engine, said = Engine(PARAMS), []
    for a, i, b, j in pairs:
        candidates = engine.propose(_PLACES[a][i], _PLACES[b][j])
        verdict = judge(candidates)
        score = candidates[0].verification.score if candidates else -np.inf
        said.append(("accepted" if isinstance(verdict, Candidate) else verdict[0].value, float(score)))
    return said


def _begin(places: list[list[Keyframe]]) -> None:
    cv2.setNumThreads(1)
    _PLACES[:] = places


def places_of(recordings: Sequence[Path], plans: Sequence[Plan], frames: int, asked: Any) -> Iterator[list[Keyframe]]:
    """The keyframes of every recording, real ones by the detector and simulated ones by their true boxes."""
    for path in recordings:
        with read_source(path, asked, 1) as source:
            yield keyframes_of(source.frames)
    for plan in plans:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording"
            sensors = sensors_of(camera_of(plan.camera, None), plan.stress, plan.rig, plan.sensor)
            simulate(path, plan.scenario, plan.seed, frames, sensors=sensors, jpeg=True, threads=2)
            with read_source(path, detector_of(TRUE_BOXES), 1) as source:
                yield keyframes_of(source.frames)


@click.command()
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option(
    "--simulate",
    "plans",
    multiple=True,
    callback=lambda *given: [plan_of(text) for text in given[2]],
    help="SCENARIO:SEED[...], as false_closures.py.",
)
@click.option("--frames", default=120, show_default=True, help="Frames of a simulated recording.")
@click.option("--pairs", "count", default=10000, show_default=True)
@click.option("--model", default="", help="ONNX model; empty: the default one.")
@click.option("--threshold", default=0.5, show_default=True)
@click.option("--processes", default=2, show_default=True)
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path))
def main(
    recordings: Sequence[Path],
    plans: Sequence[Plan],
    frames: int,
    count: int,
    model: str,
    threshold: float,
    processes: int,
    seed: int,
    json_file: Path | None,
) -> None:
    """Force keyframes of different RECORDINGS upon each other, and count what is accepted."""
    cv2.setNumThreads(1)
    places = list(places_of(recordings, plans, frames, detector_of(model, threshold)))
    names = [path.name for path in recordings] + [plan.name for plan in plans]
    drawn = strangers(places, count, seed)
    blocks = [drawn[k : k + BLOCK] for k in range(0, len(drawn), BLOCK)]
    start = time.perf_counter()
    with ProcessPoolExecutor(processes, initializer=_begin, initargs=(places,)) as pool:
        said = [one for block in tqdm(pool.map(tried, blocks), total=len(blocks)) for one in block]
    reasons = Counter(reason for reason, _ in said)
    best = np.array([score for _, score in said])
    judged = zip(drawn, said, strict=True)
    accepted = [[names[a], i, names[b], j] for (a, i, b, j), (reason, _) in judged if reason == "accepted"]
    click.echo(
        f"{len(said)} pairs of {len(names)} places, {len(accepted)} accepted, {time.perf_counter() - start:.0f} s"
    )
    click.echo(f"  best view scores: p99 {np.percentile(best, 99):.2f}, largest {best.max():.2f}")
    click.echo(f"  {', '.join(f'{reason} {n}' for reason, n in reasons.most_common())}")
    for lie in accepted:
        click.echo(f"  accepted: {lie}")
    if json_file is not None:
        result = {"places": names, "pairs": len(said), "accepted": accepted, "reasons": dict(reasons)}
        json_file.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
