# SPDX-License-Identifier: Apache-2.0
"""Does it close loops? Ours and its peers on the same recordings, by truth, in one run.

For every recording and method: constraints, true ones (within 5 degrees and 10 cm), false ones (worse than 8 degrees or
15 cm), the share of the revisits that were closed by view change, milliseconds a pair, and the trajectory error of
drifting odometry before and after the same pose graph took the method's constraints. The oracle's constraints are
perfect and there is one for every revisit: its trajectory error is what no closing of loops can take away.

    python benchmarks/closure.py ../shared/data/redkitchen_a --model ../shared/models/ssd_mobilenet_v1_coco_int8.onnx
    python benchmarks/closure.py --simulate loop:0,1,2,3,4 --simulate moved:0,1,2,3,4 --json closure.json
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from peers import Peer, peers
from sources import Source, read_source

from objreg_ros.data import Array, Frame, LoopClosure, Odometry, Reason
from objreg_ros.geometry import inverse, rotation_angle
from objreg_ros.mapper.pose_graph import PoseGraph
from objreg_ros.offline import constraint
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.report.revisits import Revisit, Seen, recall_by_view_change, revisits
from objreg_ros.report.trajectory_error import absolute_trajectory_error
from objreg_ros.simulation.write import simulate
from objreg_ros.truth import FALSE, LOOSE, Truth, within

GAP_NS = 2_000_000_000  # what is nearer in time is no loop
TOLERANCE_NS = 1_000_000_000  # a keyframe spans up to a second
KEYFRAME_MOTION = (0.15, 8.0)  # m, degrees: as often as the registrar by default
AHEAD = np.array([0.0, 0.0, 1.2, 1.0])  # what a camera looks at, about
PEER_COVARIANCE = np.diag([0.05**2] * 3 + [np.radians(2.0) ** 2] * 3)
ORACLE_COVARIANCE = np.diag([0.005**2] * 3 + [np.radians(0.2) ** 2] * 3)
UNTRIED = (Reason.NO_CANDIDATE, Reason.REDUNDANT, Reason.OVER_BUDGET)


@dataclass
class Result:
    """What one method made of one recording."""

    closures: list[LoopClosure]
    pairs: int
    seconds: float
    prepare_seconds: float = 0.0


def ours(source: Source, seed: int) -> Result:
    """The registrar, frame by frame."""
    registrar = Registrar(RegistrarParams(seed=seed))
    closures: list[LoopClosure] = []
    tried, start = 0, time.perf_counter()
    for frame in source.frames:
        outcome = registrar.process(frame)
        closures += outcome.closures
        tried += len(outcome.closures) + sum(r.reason not in UNTRIED for r in outcome.rejected)
    outcome = registrar.finish()
    closures += outcome.closures
    tried += len(outcome.closures) + sum(r.reason not in UNTRIED for r in outcome.rejected)
    seconds = time.perf_counter() - start
    registrar.close()
    return Result(closures, tried, seconds)


def oracle(source: Source, found: Sequence[Revisit]) -> Result:
    """A perfect constraint for every revisit: what is left of the trajectory's error then, no method can take away."""
    answers = [
        (revisit.from_ns, revisit.to_ns, source.truth.between(revisit.from_ns, revisit.to_ns)) for revisit in found
    ]
    return Result([_closure(a, b, T, ORACLE_COVARIANCE) for a, b, T in answers if T is not None], len(answers), 0.0)


def theirs(peer: Peer, source: Source, keyframes: Sequence[Frame], pairs: Sequence[tuple[int, int]]) -> Result:
    """A peer on pairs of keyframes (earlier, later)."""
    result = Result([], len(pairs), 0.0)
    used = sorted({k for pair in pairs for k in pair})
    prepared = {}
    for k in used:
        shot = source.shot(keyframes[k])
        start = time.perf_counter()
        prepared[k] = peer.prepare(shot)
        result.prepare_seconds += time.perf_counter() - start
    for a, b in pairs:
        start = time.perf_counter()
        answer = peer.register(prepared[a], prepared[b])
        result.seconds += time.perf_counter() - start
        if answer is not None and answer.accepted:
            moments = keyframes[a].stamp_ns, keyframes[b].stamp_ns
            result.closures.append(_closure(*moments, answer.T_from_to, PEER_COVARIANCE))
    return result


def _closure(from_ns: int, to_ns: int, T_from_to: Array, covariance: Array) -> LoopClosure:
    return LoopClosure(from_ns=from_ns, to_ns=to_ns, T_from_to=T_from_to, covariance=covariance, labels=())


def keyframes_of(frames: Sequence[Frame]) -> list[Frame]:
    """Frames that are apart by `KEYFRAME_MOTION` in odometry."""
    kept: list[Frame] = []
    for frame in frames:
        if frame.T_odom_camera is None:
            continue
        if kept and kept[-1].T_odom_camera is not None:
            motion = inverse(kept[-1].T_odom_camera) @ frame.T_odom_camera
            near = np.linalg.norm(motion[:3, 3]) < KEYFRAME_MOTION[0]
            if near and np.degrees(rotation_angle(motion[:3, :3])) < KEYFRAME_MOTION[1]:
                continue
        kept.append(frame)
    return kept


def candidate_pairs(keyframes: Sequence[Frame], most: int) -> list[tuple[int, int]]:
    """For every keyframe the earlier ones that by odometry look at the nearest place, as every SLAM proposes them."""
    looked_at = [T @ AHEAD for T in (keyframe.T_odom_camera for keyframe in keyframes) if T is not None]
    pairs = []
    for b, later in enumerate(keyframes):
        earlier = [a for a in range(b) if later.stamp_ns - keyframes[a].stamp_ns >= GAP_NS]
        earlier.sort(key=lambda a: float(np.linalg.norm(looked_at[a] - looked_at[b])))
        pairs += [(a, b) for a in earlier[:most]]
    return pairs


def judged(result: Result, source: Source, found: Sequence[Revisit]) -> dict[str, Any]:
    """A method's result against the truth."""
    truth = source.truth
    errors = [error for closure in result.closures if (error := truth.error(closure)) is not None]
    recall = recall_by_view_change(found, result.closures, truth, TOLERANCE_NS)
    before, after, pruned = trajectory_errors(source.frames, result.closures, truth)
    return {
        "constraints": len(result.closures),
        "true": sum(within(error, LOOSE) for error in errors),
        "false": sum(not within(error, FALSE) for error in errors),
        "recall": {name: {"closed": closed, "of": of} for name, (closed, of) in recall.items()},
        "pairs": result.pairs,
        "ms_per_pair": round(1e3 * result.seconds / max(result.pairs, 1), 2),
        "prepare_seconds": round(result.prepare_seconds, 2),
        "ate_cm": {"before": round(100 * before, 2), "after": round(100 * after, 2)},
        "ate_reduced": round(1 - after / before, 3) if before else 0.0,
        "pruned": pruned,
        "rotation_deg": _median([error[0] for error in errors]),
        "translation_cm": _median([error[1] for error in errors]),
        "closures": [constraint(closure) for closure in result.closures],
    }


def _median(values: Sequence[float]) -> float | None:
    return round(float(np.median(values)), 3) if values else None


def trajectory_errors(
    frames: Sequence[Frame], closures: Sequence[LoopClosure], truth: Truth
) -> tuple[float, float, int]:
    """The trajectory error in m by odometry and in the map, and how many closures the map pruned."""
    graph = PoseGraph()
    for frame in frames:
        if frame.T_odom_camera is not None:
            graph.add_odometry(Odometry(T_odom_body=frame.T_odom_camera, stamp_ns=frame.stamp_ns))
    for closure in closures:
        graph.add_closure(closure)
    pruned = len(graph.optimise().pruned)
    known = [(stamp, T, true) for stamp, T in graph.odometry if (true := truth.at(stamp)) is not None]
    true = [row[2] for row in known]
    before = absolute_trajectory_error([row[1] for row in known], true)
    after = absolute_trajectory_error(graph.corrected(row[0] for row in known), true)
    return before, after, pruned


def compare(source: Source, wanted: Sequence[Peer], candidates: int, seed: int) -> dict[str, Any]:
    """Every method on one recording."""
    keyframes = keyframes_of(source.frames)
    seen = [Seen(f.stamp_ns, f.view, T) for f in keyframes if (T := source.truth.at(f.stamp_ns)) is not None]
    found = revisits(seen, GAP_NS)
    pairs = candidate_pairs(keyframes, candidates)
    click.echo(f"{len(source.frames)} frames, {len(keyframes)} keyframes, {len(pairs)} pairs for each peer", err=True)
    methods = {"objreg": judged(ours(source, seed), source, found)}
    for peer in wanted:
        click.echo(f"  {peer.name}", err=True)
        methods[peer.name] = judged(theirs(peer, source, keyframes, pairs), source, found)
    methods["oracle"] = judged(oracle(source, found), source, found)
    return {"frames": len(source.frames), "keyframes": len(keyframes), "revisits": len(found), "methods": methods}


def totals(recordings: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Over all recordings: counts are added, the trajectory error's reduction is the worst and the median."""
    out: dict[str, dict[str, Any]] = {}
    for name in dict.fromkeys(m for row in recordings.values() for m in row["methods"]):
        rows = [row["methods"][name] for row in recordings.values()]
        pairs = sum(row["pairs"] for row in rows)
        bins = rows[0]["recall"]
        out[name] = {
            **{key: sum(row[key] for row in rows) for key in ("constraints", "true", "false", "pruned")},
            "recall": {b: {k: sum(row["recall"][b][k] for row in rows) for k in ("closed", "of")} for b in bins},
            "ms_per_pair": round(sum(row["ms_per_pair"] * row["pairs"] for row in rows) / max(pairs, 1), 2),
            "ate_reduced_worst": min(row["ate_reduced"] for row in rows),
            "ate_reduced_median": round(float(np.median([row["ate_reduced"] for row in rows])), 3),
        }
    return out


def table(name: str, row: dict[str, Any]) -> str:
    """The methods of one recording as text."""
    head = f"{name}: {row['frames']} frames, {row['keyframes']} keyframes, {row['revisits']} revisits"
    lines = [head, f"  {'method':10} {'constr.':>7} {'true':>5} {'false':>5} {'recall':>7} {'ms/pair':>8}  ATE cm"]
    for method, m in row["methods"].items():
        every = m["recall"]["all"]
        lines.append(
            f"  {method:10} {m['constraints']:7} {m['true']:5} {m['false']:5} {every['closed']:3}/{every['of']:<3} "
            f"{m['ms_per_pair']:8.1f}  {m['ate_cm']['before']:.1f} → {m['ate_cm']['after']:.1f}"
        )
    return "\n".join(lines)


@contextmanager
def simulated(story: str, seed: int, frames: int) -> Iterator[Path]:
    """A recording of a scenario, gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"{story}_{seed}")
        simulate(path, story, seed, frames, jpeg=True)
        yield path


def stories(texts: Sequence[str]) -> list[tuple[str, int]]:
    """``loop:0,1`` as (loop, 0), (loop, 1)."""
    found = []
    for text in texts:
        name, _, seeds = text.partition(":")
        found += [(name, int(seed)) for seed in (seeds or "0").split(",")]
    return found


@click.command()
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option("--simulate", "scenarios", multiple=True, metavar="SCENARIO:SEED,SEED…", help="Make and use a recording.")
@click.option("--frames", default=600, show_default=True, help="Frames of a simulated recording.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--model", default="", help="ONNX model; `truth` takes the true boxes of a simulated recording.")
@click.option("--peers", "names", default="orb_pnp,fpfh_icp,paper", show_default=True, help="Methods to compare with.")
@click.option("--candidates", default=3, show_default=True, help="Pairs that a peer may try for each keyframe.")
@click.option("--seed", default=1, show_default=True, help="Of the synthetic drift and of the registrar.")
def main(
    recordings: tuple[Path, ...],
    scenarios: tuple[str, ...],
    frames: int,
    json_file: Path | None,
    model: str,
    names: str,
    candidates: int,
    seed: int,
) -> None:
    """Compare loop closure on RECORDINGS that have ground truth."""
    wanted = peers(tuple(name for name in names.split(",") if name))
    rows: dict[str, dict[str, Any]] = {}

    def take(path: Path) -> None:
        click.echo(f"{path.name}: detecting and segmenting", err=True)
        with read_source(path, model, seed) as source:
            rows[path.name] = compare(source, wanted, candidates, seed)
        click.echo(table(path.name, rows[path.name]))
        if json_file is not None:
            json_file.write_text(json.dumps({"recordings": rows, "total": totals(rows)}, indent=1))

    for path in recordings:
        take(path)
    for name, number in stories(scenarios):
        with simulated(name, number, frames) as path:
            take(path)


if __name__ == "__main__":
    main()
