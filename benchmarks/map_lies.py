# SPDX-License-Identifier: Apache-2.0
"""Random graphs with false closures, and what mappers make of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from map_peers import PEERS, Dense, Solved

from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.simulation.walk import PERIOD_NS, Walk, WalkParams, walk

OURS, CLEAN_LM = "objreg", "GTSAM LM, right ones alone"
SHARES, AGREEING = (0.1, 0.2, 0.3), (0.0, 0.1)
WORST_M = (1.0, 10.0, 1e9)
TOO_MUCH = (1.3, 2.0)


def drawn(seed: int) -> tuple[Walk, dict[str, Any]]:
    """The random graph of a seed, and what was drawn for it. A third of those with lies have some that agree."""
    rng = np.random.default_rng([seed, 9])
    share = float(rng.choice(SHARES))
    agreeing = min(float(rng.choice(AGREEING, p=(2 / 3, 1 / 3))), share)
    worst = float(rng.choice(WORST_M))
    params = WalkParams(
        poses=int(rng.integers(80, 300)),
        closures=int(rng.integers(10, 50)),
        corridor_m=float(rng.uniform(2, 6)),
        false_share=share - agreeing,
        agreeing_share=agreeing,
        lie_m=(0.1, worst),
    )
    return walk(params, seed), {"seed": seed, "false_share": share, "agreeing_share": agreeing, "worst_m": worst}


def filled(walk: Walk, right_only: bool, params: MapperParams | None = None) -> tuple[PoseGraph, Array, int]:
    """A graph with a walk in it, unsolved; whether each closure in it is false, and how many were refused at once."""
    graph, is_false, refused = PoseGraph(params), list[bool](), 0
    for odometry in walk.odometry:
        graph.add_odometry(odometry)
    for closure, false in zip(walk.closures, walk.is_false.tolist(), strict=True):
        if right_only and false:
            continue
        before = len(graph.ties)
        try:
            graph.add_closure(closure)
        except ValueError:
            refused += 1
        is_false += [false] * (len(graph.ties) - before)
    return graph, np.array(is_false, bool), refused


def error_of(walk: Walk, graph: PoseGraph, poses: Array) -> float:
    """The trajectory error of keyframes, m."""
    true = [walk.T_world_body[stamp // PERIOD_NS] for stamp in graph.keyframes.stamps_ns]
    return absolute_trajectory_error(list(poses), true) if np.isfinite(poses).all() else float("inf")


def solved(graph: PoseGraph) -> Solved:
    """As our mapper has it."""
    problem = graph.problem()
    solution = problem.solve()
    graph.adopt_solution(problem, solution)
    return Solved(np.array([T for _, T in graph.path()]), solution.kept)


def one(seed: int, peers: list[str], params: MapperParams | None = None) -> dict[str, Any] | None:
    """Ours and its peers on one graph: the error over that of ours without the false ones, and what was believed.

    None of a walk that met no place again or has no false closure.
    """
    walk, row = drawn(seed)
    if walk.is_false.all() or not walk.is_false.any():
        return None
    graph, _, _ = filled(walk, right_only=True, params=params)
    clean = error_of(walk, graph, solved(graph).poses)
    limit = graph.params.max_residual
    row["clean_m"], row["methods"] = clean, {}
    dense = Dense.of(graph, graph.params.picture_sigmas)
    right = np.zeros(len(dense.closures), bool)
    row["methods"][CLEAN_LM] = judged(walk, graph, PEERS["GTSAM LM"](dense, limit), right, clean)
    graph, is_false, refused = filled(walk, right_only=False, params=params)
    row |= {"closures": len(is_false), "false": int(is_false.sum()), "implausible": refused}
    row["methods"][OURS] = judged(walk, graph, solved(graph), is_false, clean)
    dense = Dense.of(graph, graph.params.picture_sigmas)
    for name in peers:
        try:
            answer = PEERS[name](dense, limit)
        except RuntimeError:  # GTSAM's, of a graph that it cannot solve
            answer = Solved(dense.poses, np.zeros(len(dense.closures), bool))
        row["methods"][name] = judged(walk, graph, answer, is_false, clean)
    return row


def judged(walk: Walk, graph: PoseGraph, answer: Solved, is_false: Array, clean: float) -> dict[str, float]:
    """How an answer compares with the clean one."""
    return {
        "ratio": error_of(walk, graph, answer.poses) / clean,
        "false_kept": int((answer.kept & is_false).sum()),
        "right_pruned": int((~answer.kept & ~is_false).sum()),
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Over all graphs, by method."""
    found = {}
    for name in rows[0]["methods"]:
        ratios = np.array([row["methods"][name]["ratio"] for row in rows])
        found[name] = {
            "median": float(np.median(ratios)),
            "p90": _percentile(ratios, 90),
            "p99": _percentile(ratios, 99),
            **{f"above_{bound:g}": float((ratios > bound).mean()) for bound in TOO_MUCH},
            **{key: sum(row["methods"][name][key] for row in rows) for key in ("false_kept", "right_pruned")},
        }
    return found


def _percentile(ratios: Array, share: float) -> float:
    return float(np.percentile(ratios, share, method="nearest"))  # some are infinite


def table(rows: list[dict[str, Any]]) -> str:
    """The summary as text."""
    false, refused = sum(row["false"] for row in rows), sum(row["implausible"] for row in rows)
    right = sum(row["closures"] for row in rows) - false
    lines = [
        f"{len(rows)} graphs: {right} right closures, {false} false ones, and {refused} more that were implausible",
        f"{'method':28} {'median':>8} {'p90':>8} {'p99':>9} {'> 1.3':>7} {'> 2':>7}"
        f" {'false kept':>11} {'right pruned':>13}",
    ]
    for name, figures in summary(rows).items():
        shares = " ".join(f"{100 * figures[f'above_{bound:g}']:>5.1f} %" for bound in TOO_MUCH)
        lines.append(
            f"{name:28} {figures['median']:>8.3f} {figures['p90']:>8.3g} {figures['p99']:>9.3g} {shares}"
            f" {figures['false_kept']:>11} {figures['right_pruned']:>13}"
        )
    return "\n".join(lines)
