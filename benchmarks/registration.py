# SPDX-License-Identifier: Apache-2.0
"""Registration in the simulator, where the true pose is known: single objects, four objects, and what must be refused.

One object stands on a table in a room (a chair on the floor), and the camera goes around it by 0 to 180 degrees: right
is at most 5 degrees and 2 cm in the pose of the object, up to its symmetry. Four objects: right is the same of the
camera's motion at their middle, without that excuse. What must be refused is another instance of the same kind, or
another object, each in a room of its own; an accepted pose of the camera beyond 8 degrees or 15 cm is false too.
`success`, `joint_success` and `ms` are of the objects' shapes and the views, prepared before; `engine_*`, what is
accepted and the covariance are of the whole engine and its gate, the latter without what a wrong calibration adds: the
simulated camera has none. With `stored` the object is known from four sides.
`recall_accepted` is of the pairs for which the engine's best pose is right: what the gate lets through.
`accepted_share` is of all pairs that show the same: found right and accepted.
Beside ours, in the same run: the usual ways to register two object clouds, on the same looks, at some of the angles.

    python benchmarks/registration.py --seed 7 --cache CACHE --json registration.json

`--cache` keeps every finished piece, so that a run that was stopped goes on where it was, if the code is the same. Each
condition has a process of its own; `--processes 1` runs them one after the other, for times that nothing disturbs.
`--quick` is small pieces of the same in a fixed order, as many as fit into its time.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from closure import code
from cloud_peers import Peer, cloud_peers
from command_line import given
from looks import Setting, Shot, Shots, around, four, strangers
from paper import TABLE_1, Stage
from pose_figures import SUCCESS, error_at, grouped, judged, mean, median, nees, percentiles
from sources import SIMULATED

from objreg_ros.geometry import inverse, pose_error, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import covariance_of
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.verdict import judge
from objreg_ros.registration.propose.hypotheses import Hypothesis
from objreg_ros.registration.propose.object_poses import from_shapes
from objreg_tools.simulation.params import StressParams
from objreg_tools.truth import FALSE, within

CONDITIONS = {
    "clean": StressParams(),
    "stress": StressParams(depth_bias=0.003, warp=0.003, ragged=1.0, motion_blur=2.0),
}
NOTHING = (180.0, 1e3)  # the error where there is no pose
ASIDE = 0.18  # m from the middle of the table
STORED = (0.0, 60.0, 120.0, 180.0)  # sides that an object is known from
QUICK_SECONDS, LEAST = 40.0, 3  # after which a quick run begins no piece beyond the least
STAGES = 5  # strangers of each kind that are shown to each other
SYMMETRIC = ("soda_can", "bowl")
ASYMMETRIC = ("cereal_box", "chair", "monitor", "flashlight", "book", "keyboard")  # a cap shows next to nothing


class Bench:
    """One condition: pairs that must be registered, pairs that must be refused, piece by piece."""

    def __init__(self, condition: str, seed: int, cache: Path | None = None) -> None:
        self.params = RegistrarParams().replaced(**SIMULATED)
        self.calibrated = self.params.replaced(covariance_calibration=0.0)
        self.engine = Engine(self.params)
        self.seed = seed
        self.setting = Setting(CONDITIONS[condition], seed, self.params)
        self._cache = None if cache is None else cache / f"{condition}_{seed}_{code()}"
        self.rows: list[dict[str, Any]] = []
        self.joint: list[dict[str, Any]] = []
        self.negatives: list[dict[str, Any]] = []
        self.peers: list[dict[str, Any]] = []

    def single(self, label: str, number: int, angles: Sequence[float]) -> None:
        """One object from all angles against the first look, and against four stored ones."""
        self.rows += self._piece(named("single", label, number, angles), lambda: self._single(label, number, angles))

    def _single(self, label: str, number: int, angles: Sequence[float]) -> list[dict[str, Any]]:
        stage, shots = self._staged(label, number)
        first = shots.first(0.0)
        stored = [shots.first(angle) for angle in STORED]
        rows = []
        for angle in angles:
            second = shots.next(angle)
            row = self.registered(first, second)
            T = row.pop("T_engine")
            row["engine_error"] = NOTHING if T is None else stage.error(T, first.T_world_camera, second.T_world_camera)
            row["error"] = object_error(stage, first, second, row.pop("found"))
            best = max(stored, key=lambda one: score_of(laid(second, one, self.params)[0]))
            row["stored_error"] = object_error(stage, best, second, laid(second, best, self.params)[0])
            row["yaw_unknown"] = yaw_unknown(second, self.params)
            rows.append(row | {"label": label, "angle": angle})
        return [judged(row) for row in rows]

    def compare(self, label: str, number: int, angles: Sequence[float], peers: dict[str, Peer]) -> None:
        """The peers on the same looks at one object."""
        name = named("peers", label, number, angles)
        self.peers += self._piece(name, lambda: self._compare(label, number, angles, peers))

    def _compare(
        self, label: str, number: int, angles: Sequence[float], peers: dict[str, Peer]
    ) -> list[dict[str, Any]]:
        stage, shots = self._staged(label, number)
        return [
            {name: peer_success(peer, stage, shots.first(0.0), second) for name, peer in peers.items()}
            for second in map(shots.next, angles)
        ]

    def _staged(self, label: str, number: int) -> tuple[Stage, Shots]:
        stage = Stage.of(label, 1000 * self.seed + number, ASIDE)
        return stage, Shots(
            self.setting, stage, lambda angle, hand: stage.camera((angle, 0.0, 0.0), hand), [label, number]
        )

    def together(self, number: int, angles: Sequence[float]) -> None:
        """Four objects from all angles against the first look."""
        self.joint += self._piece(named("four", "", number, angles), lambda: self._together(number, angles))

    def _together(self, number: int, angles: Sequence[float]) -> list[dict[str, Any]]:
        stage = four(1000 * self.seed + number)
        shots = Shots(self.setting, stage, lambda angle, hand: around(stage, angle, hand), ["four", number])
        first, rows = shots.first(0.0), []
        for angle in angles:
            second = shots.next(angle)
            row = self.registered(first, second)
            truth = inverse(first.T_world_camera) @ second.T_world_camera
            middle = transform(inverse(second.T_world_camera), stage.T_world_object[:3, 3])
            T, found = row.pop("T_engine"), row.pop("found")
            row["engine_error"] = NOTHING if T is None else error_at(T, truth, middle)
            row["error"] = NOTHING if found is None else error_at(found.T_target_source, truth, middle)
            rows.append(row | {"angle": angle})
        return [judged(row) for row in rows]

    def refuse(self, labels: Sequence[str], part: int, count: int) -> None:
        """Pairs of looks at different rooms, half of them at the same kind of object: whatever is accepted is a lie.

        No pair is tried twice.
        """
        name = f"refused_{len(labels)}_{part}_{count}"
        self.negatives += self._piece(name, lambda: self._refuse(labels, part, count))

    def _refuse(self, labels: Sequence[str], part: int, count: int) -> list[dict[str, Any]]:
        rng = np.random.default_rng([self.seed, 9, part])
        rooms = range(STAGES * part, STAGES * (part + 1))
        shots = {(label, n): self._stranger(label, n) for label in labels for n in rooms}
        rows = []
        for first, second in strangers(list(shots), count, rng):
            verdict = judge(self.engine.propose(shots[first].key, shots[second].key))
            rows.append({"labels": [first[0], second[0]], "accepted": isinstance(verdict, Candidate)})
        return rows

    def _stranger(self, label: str, number: int) -> Shot:
        return self._staged(label, 500 + number)[1].next(0.0)

    def registered(self, first: Shot, second: Shot) -> dict[str, Any]:
        """What the shapes find, and the engine's best pose ``T_first_second``: if it is accepted, if that is a lie."""
        found, ms = laid(second, first, self.params)
        start = time.perf_counter()
        candidates = self.engine.propose(second.key, first.key)
        verdict = judge(candidates)
        engine_ms = 1e3 * (time.perf_counter() - start)
        best = verdict if isinstance(verdict, Candidate) else (candidates[0] if candidates else None)
        row: dict[str, Any] = {"found": found, "ms": ms, "engine_ms": engine_ms, "T_engine": None, "nees": None}
        row |= {"accepted": isinstance(verdict, Candidate), "false": False, "right": False}
        row["why"] = "" if isinstance(verdict, Candidate) else verdict[0].value
        if best is not None:
            truth = inverse(first.T_world_camera) @ second.T_world_camera
            row["T_engine"] = best.T_target_source
            row["pose_error"] = pose_error(best.T_target_source, truth)
            row["right"] = within(row["pose_error"], FALSE)
            row["false"] = row["accepted"] and not row["right"]
            if row["accepted"]:
                row["nees"] = nees(best.T_target_source, truth, covariance_of(best, self.calibrated))
        return row

    def figures(self) -> dict[str, Any]:
        """The figures of this condition."""
        rows, joint, both = self.rows, self.joint, self.rows + self.joint
        right = [row for row in rows if row["success"]]
        spread = [row["nees"] for row in both if row["nees"] is not None and not row["false"]]
        closable = [row for row in both if row["engine_success"] and row["right"]]
        return {
            "success": mean(rows, "success"),
            "success_90": mean([row for row in rows if row["angle"] <= 90], "success"),
            "by_object": grouped(rows, "label"),
            "by_angle": grouped(rows, "angle"),
            "stored_success": mean(rows, "stored_success"),
            "engine_success": mean(rows, "engine_success"),
            "joint_success": mean(joint, "success"),
            "joint_engine_success": mean(joint, "engine_success"),
            "rotation_deg": median([row["error"][0] for row in right]),
            "translation_cm": median([row["error"][1] for row in right]),
            "pairs": len(rows),
            "joint_pairs": len(joint),
            "negatives": len(self.negatives),
            "tried": len(both) + len(self.negatives),
            "false_accepted": sum(row["false"] for row in both) + sum(row["accepted"] for row in self.negatives),
            "accepted_share": sum(row["accepted"] for row in closable) / len(both) if both else None,
            "recall_accepted": mean(closable, "accepted"),
            "recall_accepted_single": mean([row for row in closable if "label" in row], "accepted"),
            "recall_accepted_joint": mean([row for row in closable if "label" not in row], "accepted"),
            "refused_though_right": dict(Counter(row["why"] for row in closable if not row["accepted"])),
            "symmetry_recall": mean([row for row in rows if row["label"] in SYMMETRIC], "yaw_unknown"),
            "symmetry_false_alarm": mean([row for row in rows if row["label"] in ASYMMETRIC], "yaw_unknown"),
            "false": [
                {key: row.get(key, "four") for key in ("label", "angle", "pose_error")} for row in both if row["false"]
            ]
            + [row["labels"] for row in self.negatives if row["accepted"]],
            "nees_mean": float(np.mean(spread)) if spread else None,
            **percentiles("ms", [row["ms"] for row in rows]),
            **percentiles("joint_ms", [row["ms"] for row in joint]),
            **percentiles("engine_ms", [row["engine_ms"] for row in both]),
            "peers": {name: mean(self.peers, name) for name in (self.peers[0] if self.peers else ())},
            "peer_pairs": len(self.peers),
        }

    def _piece(self, name: str, make: Callable[[], list[dict[str, Any]]]) -> list[dict[str, Any]]:
        """The rows of a piece, made now or in a run before."""
        if self._cache is None:
            return make()
        file = self._cache / f"{name}.json"
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(make(), default=float))
        rows: list[dict[str, Any]] = json.loads(file.read_text())
        return rows


def named(kind: str, label: str, number: int, angles: Sequence[float]) -> str:
    """The name of a piece: another for other angles."""
    return f"{kind}_{label}_{number}_" + "_".join(f"{angle:.0f}" for angle in angles)


def laid(source: Shot, target: Shot, params: RegistrarParams) -> tuple[Hypothesis | None, float]:
    """The best pose of the objects by their shapes and the views, None without one; and its milliseconds."""
    a, b = source.prepared(params), target.prepared(params)
    start = time.perf_counter()
    found = from_shapes(a, b)
    return (found[0] if found else None), 1e3 * (time.perf_counter() - start)


def score_of(found: Hypothesis | None) -> float:
    """What a pose is worth; less than any for none."""
    return -np.inf if found is None else found.support


def object_error(stage: Stage, first: Shot, second: Shot, found: Hypothesis | None) -> tuple[float, float]:
    """The error of the object's pose that was found."""
    if found is None:
        return NOTHING
    return stage.error(found.T_target_source, first.T_world_camera, second.T_world_camera)


def yaw_unknown(shot: Shot, params: RegistrarParams) -> bool:
    """Whether the object of a look says itself that its yaw is not to be known."""
    if not shot.frame.objects or shot.frame.gravity is None:
        return False
    return not any(shot.prepared(params).yaw_known)


def peer_success(peer: Peer, stage: Stage, first: Shot, second: Shot) -> bool:
    """Whether a peer registers the two clouds of the object."""
    if not first.frame.objects or not second.frame.objects:
        return False
    T = peer(second.frame.objects[0].xyz.astype(float), first.frame.objects[0].xyz.astype(float))
    return within(stage.error(T, first.T_world_camera, second.T_world_camera), SUCCESS)


def load_all() -> None:
    """Whatever the pieces run, once and thrown away, so that no pair is timed with what is imported."""
    Bench("clean", 0).together(99, [20.0])


Piece = tuple[str, Callable[[Bench], None]]


def whole(reps: int, negatives: int, every: int) -> list[Piece]:
    """The whole benchmark, piece by piece: every object and angle, the peers at every so many of them."""
    angles = [float(a) for a in range(0, 181, 10)]
    labels, peers = list(TABLE_1), cloud_peers()
    plan: list[Piece] = []
    for n in range(reps):
        plan += [(label, partial(Bench.single, label=label, number=n, angles=angles)) for label in labels]
        plan += [("four", partial(Bench.together, number=k, angles=angles[1:])) for k in (2 * n, 2 * n + 1)]
    shares = np.diff(np.linspace(0, negatives, 5).astype(int))
    plan += [("strangers", partial(Bench.refuse, labels=labels, part=k, count=int(n))) for k, n in enumerate(shares)]
    compared = [partial(Bench.compare, label=label, number=0, angles=angles[::every], peers=peers) for label in labels]
    return plan + [("peers", piece) for piece in compared]


def glimpses() -> list[Piece]:
    """Small pieces, each another place: the first three touch nearly every figure."""
    plan: list[Piece] = []
    for n, angles in enumerate(([0.0, 40.0, 90.0], [20.0, 60.0, 140.0], [80.0, 110.0, 170.0])):
        plan += [("cereal_box", partial(Bench.single, label="cereal_box", number=n, angles=angles))]
        plan += [("four", partial(Bench.together, number=n, angles=angles[1:]))]
        plan += [("strangers", partial(Bench.refuse, labels=("cereal_box",), part=n, count=8))]
        plan += [("soda_can", partial(Bench.single, label="soda_can", number=n, angles=angles))]
        others = [label for label in TABLE_1 if label not in ("cereal_box", "soda_can")]
        plan += [(label, partial(Bench.single, label=label, number=n, angles=angles)) for label in others]
    return plan


def run(
    condition: str, seed: int, cache: Path | None, size: tuple[int, int, int] | None, stop: float
) -> dict[str, Any]:
    """The figures of a condition, piece by piece: the whole of a ``size``, or glimpses.

    No piece beyond the least begins after the moment ``stop``.
    """
    bench = Bench(condition, seed, cache)
    load_all()
    for k, (name, piece) in enumerate(whole(*size) if size else glimpses()):
        if k >= LEAST and time.time() > stop:
            break
        start = time.perf_counter()
        piece(bench)
        click.echo(f"{condition} {name}: {time.perf_counter() - start:.1f} s")
    return bench.figures()


@click.command()
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--quick", is_flag=True, help="As many small pieces as fit; ends within 50 s on two cores.")
@click.option("--cache", type=click.Path(file_okay=False, path_type=Path), help="Keep finished pieces here.")
@click.option("--negatives", default=500, show_default=True, help="Pairs of different rooms, for each condition.")
@click.option("--reps", default=2, show_default=True, help="Instances of each object.")
@click.option("--every", default=2, show_default=True, help="The peers are asked at every n-th angle of one instance.")
@click.option("--processes", default=2, show_default=True, help="Conditions run at once; 1 where the times matter.")
@click.pass_context
def main(
    context: click.Context,
    seed: int,
    json_file: Path | None,
    quick: bool,
    reps: int,
    negatives: int,
    cache: Path | None,
    every: int,
    processes: int,
) -> None:
    """Register simulated objects and scenes, and refuse what is not the same."""
    sized = [f"--{name}" for name in ("reps", "negatives", "every") if given(context, name)]
    if quick and sized:
        raise click.UsageError(f"expected --quick or a size of the whole, got --quick and {' '.join(sized)}")
    start = time.time()
    stop = start + QUICK_SECONDS if quick else math.inf
    size = None if quick else (reps, negatives, every)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork")) as pool:
        found = pool.map(run, CONDITIONS, *([part] * 2 for part in (seed, cache, size, stop)))
        figures = dict(zip(CONDITIONS, found, strict=True))
    for condition, row in figures.items():
        click.echo(f"{condition}: {json.dumps({k: v for k, v in row.items() if not isinstance(v, dict)})}")
    tried = sum(row["tried"] for row in figures.values())
    click.echo(f"{tried} pairs tried in {time.time() - start:.0f} s")
    if json_file is not None:
        json_file.write_text(json.dumps({"seed": seed, **figures}, indent=1))


if __name__ == "__main__":
    main()
