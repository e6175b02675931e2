# SPDX-License-Identifier: Apache-2.0
"""A long walk through a building, solved after every closure: time, memory and error, and other optimisers beside."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from map_lies import error_of, filled, solved
from map_peers import PEERS, Dense, Solved
from tqdm import tqdm

from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_tools.simulation.walk import PERIOD_NS, Walk, WalkParams, walk

BUILDING = WalkParams(step_m=0.27, corridor_m=10.0, corridors=8, false_share=0.05, lie_m=(0.1, 30.0))
SHORT_M = 250.0  # what Open3D's dense optimiser can do
PARTS = 10  # of the walk that are reported apart


def long_walk(poses: int, closures: int, seed: int) -> Walk:
    """Corridors of 10 m, 8 by 8 of them; a pose every 27 cm, so that each is a keyframe in spite of its drift."""
    return walk(replace(BUILDING, poses=poses, closures=closures), seed)


def ours(walk: Walk) -> dict[str, Any]:
    """Odometry and closures in the order of time, with a solution after every closure."""
    graph, at = PoseGraph(), 0
    of_odometry, of_closures, of_processor = list[float](), list[float](), list[float]()
    parts, refused = list[dict[str, Any]](), 0
    ends = {len(walk.closures) * (part + 1) // PARTS for part in range(PARTS)}
    for k, closure in enumerate(tqdm(walk.closures, desc="closures"), 1):
        until = closure.to_ns // PERIOD_NS + 1
        of_odometry += [_seconds(graph.add_odometry, odometry) for odometry in walk.odometry[at:until]]
        at, start, begun = max(at, until), time.perf_counter(), time.process_time()
        try:
            graph.add_closure(closure)
        except ValueError:
            refused += 1
        summary = graph.optimise()
        of_closures.append(time.perf_counter() - start)
        of_processor.append(time.process_time() - begun)
        if k in ends:
            kept = {(one.from_ns, one.to_ns) for one in summary.kept}
            times = {
                "odometry_ms": _percentiles(of_odometry, (50, 95)),
                "closure_ms": _percentiles(of_closures, (50, 95, 100)),
                "processor_ms": _percentiles(of_processor, (50, 95)),
            }
            parts.append(_part(walk, graph, kept, times, (k, refused)))
            tqdm.write(row(parts[-1]))
            of_odometry, of_closures, of_processor = [], [], []
    return {"parts": parts, "keyframes": len(graph.keyframes)}


def _seconds(work: Callable[[Any], Any], given: Any) -> float:
    start = time.perf_counter()
    work(given)
    return time.perf_counter() - start


def _part(
    walk: Walk,
    graph: PoseGraph,
    kept: set[tuple[int, int]],
    times: dict[str, list[float]],
    counts: tuple[int, int],
) -> dict[str, Any]:
    """One part of the walk: its times, and the map as it is after it."""
    closures, refused = counts
    seen = list(zip(walk.closures[:closures], walk.is_false[:closures].tolist(), strict=True))
    return {
        "keyframes": len(graph.keyframes),
        "closures": closures,
        "implausible": refused,
        **times,
        "memory_mb": memory_mb(),
        "false": sum(false for _, false in seen),
        "false_kept": sum(false and (closure.from_ns, closure.to_ns) in kept for closure, false in seen),
        "right_pruned": sum(not false and (closure.from_ns, closure.to_ns) not in kept for closure, false in seen),
        "ate_m": error_of(walk, graph, np.array([T for _, T in graph.path()])),
    }


def memory_mb() -> float:
    """The most that this process ever had, its libraries and the walk itself among it."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def _percentiles(seconds: list[float], shares: tuple[float, ...]) -> list[float]:
    return [round(1e3 * float(value), 3) for value in np.percentile(seconds, shares)] if seconds else []


def shortened(walk: Walk, metres: float) -> Walk:
    """The beginning of a walk."""
    count = int(metres / BUILDING.step_m)
    inside = np.array([closure.to_ns < count * PERIOD_NS for closure in walk.closures], bool)
    closures = tuple(closure for closure, is_inside in zip(walk.closures, inside.tolist(), strict=True) if is_inside)
    return Walk(walk.T_world_body[:count], walk.odometry[:count], closures, walk.is_false[inside])


def at_once(walk: Walk, names: list[str], with_ours: bool = True) -> dict[str, Any]:
    """Ours, without a solution before the last closure, and peers on the same graph."""
    graph, is_false, _ = filled(walk, right_only=False)
    dense, figures = Dense.of(graph, graph.params.picture_sigmas), {}
    limit = graph.params.max_residual
    work: dict[str, Callable[[], Solved]] = {"objreg": lambda: solved(graph)} if with_ours else {}
    work |= {name: lambda name=name: PEERS[name](dense, limit) for name in names}  # type: ignore[misc]
    for name in tqdm(work, desc=f"{len(dense.poses)} keyframes at once"):
        start = time.perf_counter()
        answer = work[name]()
        seconds = time.perf_counter() - start
        figures[name] = _judged(walk, graph, answer, is_false) | {"seconds": seconds, "memory_mb": memory_mb()}
    return {"keyframes": len(dense.poses), "closures": len(is_false), "methods": figures}


def _judged(walk: Walk, graph: PoseGraph, answer: Solved, is_false: Array) -> dict[str, Any]:
    return {
        "ate_m": error_of(walk, graph, answer.poses),
        "false_kept": int((answer.kept & is_false).sum()),
        "right_pruned": int((~answer.kept & ~is_false).sum()),
    }


HEAD = (
    f"{'keyframes':>9} {'closures':>8}   {'ms a pose (50, 95 %)':22} {'ms a closure (50, 95, 100 %)':30}"
    f" {'of processor (50, 95 %)':24} {'MB':>6} {'false kept':>12} {'right pruned':>13} {'ATE m':>7}"
)


def row(part: dict[str, Any]) -> str:
    """One part as a line."""
    odometry = ", ".join(f"{value:.2f}" for value in part["odometry_ms"])
    closing = ", ".join(f"{value:.0f}" for value in part["closure_ms"])
    processor = ", ".join(f"{value:.0f}" for value in part["processor_ms"])
    false = f"{part['false_kept']} of {part['false']}"
    return (
        f"{part['keyframes']:>9} {part['closures']:>8}   {odometry:22} {closing:30} {processor:24}"
        f" {part['memory_mb']:>6.0f} {false:>12} {part['right_pruned']:>13} {part['ate_m']:>7.3f}"
    )


def rows_at_once(figures: dict[str, Any]) -> str:
    """What every method made of one graph."""
    head = f"{figures['keyframes']} keyframes and {figures['closures']} closures at once"
    lines = [f"{head:40} {'s':>8} {'MB so far':>9} {'false kept':>11} {'right pruned':>13} {'ATE m':>9}"]
    for name, one in figures["methods"].items():
        counts = f"{one['false_kept']:>11} {one['right_pruned']:>13}"
        lines.append(f"{name:40} {one['seconds']:>8.1f} {one['memory_mb']:>9.0f} {counts} {one['ate_m']:>9.3f}")
    return "\n".join(lines)
