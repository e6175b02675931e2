# SPDX-License-Identifier: Apache-2.0
"""Pose graphs that others publish as g2o text, in space or in the plane, solved as they would have grown."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

import gtsam
import numpy as np
from map_peers import PEERS, Dense, factors_of, values_of
from tqdm import tqdm

from objreg_mapper.optimisation.edges import Edges, edges_of
from objreg_mapper.optimisation.incremental import IncrementalGraph
from objreg_mapper.optimisation.robust import RobustGraph
from objreg_mapper.params import MapperParams
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse

START, LM, BELIEVED, ROBUST = "as the file has it", "GTSAM LM", "objreg, all believed", "objreg"
IN_PLANE = [2, 3, 4]  # of [r t]: the turn and the position of a pose in the plane


class Public(NamedTuple):
    """A graph whose nodes are each tied to one before by a step; the poses are those of the file."""

    name: str
    dense: Dense


def read(file: Path) -> Public:
    """The graph of a file. ValueError for one that is no graph of poses or has a node that none before it ties."""
    flat = "EDGE_SE2" in file.read_text(errors="replace")
    factors, values = gtsam.readG2o(str(file), not flat)
    keys = sorted(values.keys())
    if not keys:
        raise ValueError(f"{file}: expected poses, got none")
    number = {key: k for k, key in enumerate(keys)}
    poses = np.array([_lifted(values.atPose2(key)) if flat else values.atPose3(key).matrix() for key in keys])
    edges = _edges([factors.at(k) for k in range(factors.size())], number, flat)
    steps = _steps(edges, len(keys))
    rest = np.setdiff1d(np.arange(len(edges)), steps)
    in_time = rest[np.argsort(np.maximum(edges.k1[rest], edges.k2[rest]), kind="stable")]
    return Public(file.stem, Dense(poses, edges.taken(steps), edges.taken(in_time)))


def _lifted(pose2: Any) -> Array:
    """A pose in the plane as one in space (4, 4)."""
    T = np.eye(4)
    T[np.ix_([0, 1, 3], [0, 1, 3])] = pose2.matrix()
    return T


def _edges(factors: list[Any], number: dict[int, int], flat: bool) -> Edges:
    rows, whitening = [], []
    for factor in factors:
        if not isinstance(factor, gtsam.BetweenFactorPose2 if flat else gtsam.BetweenFactorPose3):
            continue
        noise: Any = factor.noiseModel()
        keys = list(factor.keys())
        measured, R = factor.measured(), np.asarray(noise.R())
        rows.append((*(number[key] for key in keys), _lifted(measured) if flat else measured.matrix()))
        whitening.append(_whitening_in_space(R) if flat else R)
    if not rows:
        return edges_of(())
    k1, k2, T = zip(*rows, strict=True)
    return Edges(np.array(k1), np.array(k2), np.array(T), np.array(whitening))


def _whitening_in_space(R: Array) -> Array:
    """(6, 6) of the error [r t] from (3, 3) of [x y turn]; what leaves the plane is held as well as what does not."""
    order = [2, 0, 1]
    information = np.diag(np.repeat([(R.T @ R)[2, 2], (R.T @ R)[0, 0]], 3))
    information[np.ix_(IN_PLANE, IN_PLANE)] = (R.T @ R)[np.ix_(order, order)]
    upper: Array = np.linalg.cholesky(information).T
    return upper


def _steps(edges: Edges, count: int) -> Array:
    """For every node but the first the edge to the latest node before it."""
    earlier, later = np.minimum(edges.k1, edges.k2), np.maximum(edges.k1, edges.k2)
    best = np.full(count, -1)
    for k in np.argsort(earlier, kind="stable"):
        if earlier[k] < later[k]:
            best[later[k]] = k
    if (best[1:] < 0).any():
        raise ValueError(f"expected every pose tied to one before it, got none for {int(np.argmin(best[1:])) + 1}")
    return best[1:]


def compare(public: Public, robust: bool) -> dict[str, Any]:
    """Chi-squared of all edges, by every method, and how long it took."""
    dense, factors = public.dense, factors_of(public.dense)
    figures: dict[str, Any] = {"poses": len(dense.poses), "edges": len(dense.steps) + len(dense.closures)}

    def note(name: str, poses: Array, seconds: float, left_out: int = 0) -> None:
        chi2 = 2 * factors.error(values_of(poses))
        figures[name] = {"chi2": float(chi2), "seconds": seconds, "left_out": left_out}

    note(START, dense.poses, 0.0)
    start = time.perf_counter()
    note(LM, PEERS[LM](dense, 0.0).poses, time.perf_counter() - start)
    start = time.perf_counter()
    note(BELIEVED, _believed(public), time.perf_counter() - start)
    if robust:
        start = time.perf_counter()
        graph = _doubted(public)
        note(ROBUST, graph.poses, time.perf_counter() - start, int((~graph.kept).sum()))
        figures[ROBUST]["truncated"] = graph.cost
    return figures


def _believed(public: Public) -> Array:
    """Poses by our incremental graph, closure by closure, none of them doubted."""
    dense = public.dense
    graph, poses = IncrementalGraph.begun(dense.poses[0]), dense.poses[:1]
    for k in tqdm(range(len(dense.closures)), desc=f"{public.name}, all believed"):
        closure = dense.closures.taken(slice(k, k + 1))
        steps = _until(dense, graph.count, int(max(closure.k1[0], closure.k2[0])))
        if len(steps):
            graph.grow(_along(graph.poses(), steps), steps)
        graph.add_edges(closure)
        graph.solve_poses()
    steps = _until(dense, graph.count, len(dense.poses) - 1)
    poses = graph.poses()
    return np.concatenate([poses, _along(poses, steps)])


def _doubted(public: Public) -> RobustGraph:
    """Our robust graph, closure by closure."""
    dense = public.dense
    graph = RobustGraph(dense.poses[0], MapperParams().max_residual ** 2)
    for k in tqdm(range(len(dense.closures)), desc=f"{public.name}, any may be false"):
        closure = dense.closures.taken(slice(k, k + 1))
        _grown(graph, dense, int(max(closure.k1[0], closure.k2[0])))
        graph.close(closure)
    _grown(graph, dense, len(dense.poses) - 1)
    return graph


def _grown(graph: RobustGraph, dense: Dense, last: int) -> None:
    steps = _until(dense, len(graph.poses), last)
    if len(steps):
        graph.grow(_along(graph.poses, steps), steps)


def _until(dense: Dense, first: int, last: int) -> Edges:
    """The steps to these nodes."""
    return dense.steps.taken(slice(first - 1, max(last, first - 1)))


def _along(poses: Array, steps: Edges) -> Array:
    """Poses (n, 4, 4) of the next nodes, from those that are there."""
    known = list(poses)
    for k1, k2, T in zip(steps.k1.tolist(), steps.k2.tolist(), steps.T_1_2, strict=True):
        known.append(known[k1] @ T if k1 < k2 else known[k2] @ inverse(T))
    return np.array(known[len(poses) :]).reshape(-1, 4, 4)


def table(name: str, figures: dict[str, Any]) -> str:
    """One graph as text."""
    head = f"{name}: {figures['poses']} poses, {figures['edges']} edges"
    lines = [f"{head:44} {'chi2':>14} {'s':>8} {'left out':>9} {'truncated':>12}"]
    for method in (START, LM, BELIEVED, ROBUST):
        if method in figures:
            one = figures[method]
            truncated = f"{one['truncated']:.1f}" if "truncated" in one else "-"
            lines.append(
                f"{method:44} {one['chi2']:>14.5g} {one['seconds']:>8.2f} {one['left_out']:>9} {truncated:>12}"
            )
    return "\n".join(lines)
