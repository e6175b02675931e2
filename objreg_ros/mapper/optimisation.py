# SPDX-License-Identifier: Apache-2.0
"""Pose-graph optimisation that survives wrong edges: Open3D's optimiser with line processes, tightened in stages.

Choi, Zhou, Koltun, "Robust Reconstruction of Indoor Scenes" (2015) give every uncertain edge a switch in 0..1 that
equals the Geman-McClure weight ``(mu / (mu + r^2))^2`` of its residual r. With drift a right edge begins far off and
would be switched off at once, so mu comes down in stages from the largest residual to the wanted one: Yang et al.,
"Graduated Non-Convexity for Robust Spatial Perception" (2020).
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, pose, vector_from_rotation

STAGE = 4.0  # mu shrinks by this factor from stage to stage
PRUNED = 0.25  # the weight of an edge whose squared residual is mu


def load() -> None:
    """Import Open3D now and not when the first map is solved: it takes seconds, in which nothing else runs."""
    import_module("open3d")


class Edge(NamedTuple):
    """``T_target_source`` between two nodes and its ``information (6, 6)``, `constraint.open3d_information`'s kind.

    An ``uncertain`` edge may be pruned.
    """

    target: int
    source: int
    T_target_source: Array
    information: Array
    uncertain: bool


class Solution(NamedTuple):
    """The poses of the nodes in the map, and for every edge whether it was ``kept``.

    ``unsolvable`` are the numbers of the edges with which there is no solution; they were left out.
    """

    poses: tuple[Array, ...]
    kept: tuple[bool, ...]
    unsolvable: tuple[int, ...] = ()


def optimise(poses: Sequence[Array], edges: Sequence[Edge], max_residual: float) -> Solution:
    """Optimise the poses (4, 4) of the nodes; the first stays where it is.

    The certain edges have to connect all nodes. An uncertain edge whose residual stays above ``max_residual`` standard
    deviations is pruned: it has no influence on the poses that come back.
    """
    kept = np.ones(len(edges), bool)
    for mu in _stages(poses, edges, max_residual**2):
        poses, weights = _optimise_once(poses, edges, mu)
        kept = weights >= PRUNED
    return _without_pruned(poses, edges, kept, max_residual)


def optimise_gradually(poses: Sequence[Array], stages: Sequence[Sequence[Edge]], max_residual: float) -> Solution:
    """As `optimise` of the edges of the last stage, led there by the same edges with more doubt in them.

    Where a closure counts as known no better than odometry has drifted, a true one is near enough from the beginning
    and a false one is not: no lie gets to bend the map before it is known as one.
    """
    kept = np.ones(len(stages[-1]), bool)
    for edges in stages:
        poses, weights = _optimise_once(poses, edges, max_residual**2)
        kept = weights >= PRUNED
    return _without_pruned(poses, stages[-1], kept, max_residual)


def misfit(poses: Sequence[Array], edges: Sequence[Edge], max_residual: float) -> float:
    """The squared residuals of all edges, those of uncertain ones up to the limit: what a solution makes least."""
    each = ((squared_residual(poses, edge), edge.uncertain) for edge in edges)
    return sum(min(squared, max_residual**2) if uncertain else squared for squared, uncertain in each)


def _without_pruned(poses: Sequence[Array], edges: Sequence[Edge], kept: Array, max_residual: float) -> Solution:
    """The solution by the edges that are kept alone."""
    if not kept.all():
        survivors = [edge for edge, keep in zip(edges, kept, strict=True) if keep]
        poses, _ = _optimise_once(poses, survivors, max_residual**2)
    return Solution(tuple(poses), tuple(bool(keep) for keep in kept))


def squared_residual(poses: Sequence[Array], edge: Edge) -> float:
    """How far the poses are from what the edge says, in squared standard deviations."""
    estimated = inverse(poses[edge.target]) @ poses[edge.source]
    error = inverse(edge.T_target_source) @ estimated
    e = np.concatenate([vector_from_rotation(error[:3, :3]), error[:3, 3]])
    return float(e @ edge.information @ e)


def _stages(poses: Sequence[Array], edges: Sequence[Edge], wanted: float) -> list[float]:
    """The values of mu, falling to ``wanted``."""
    largest = max((squared_residual(poses, edge) for edge in edges if edge.uncertain), default=0.0)
    count = int(np.ceil(np.log(max(largest / wanted, 1.0)) / np.log(STAGE)))
    return [wanted * STAGE**k for k in range(count, -1, -1)]


def _optimise_once(poses: Sequence[Array], edges: Sequence[Edge], mu: float) -> tuple[list[Array], Array]:
    """Poses and weights of the edges at one value of mu.

    About where the first node is: Open3D turns poses about the origin, and far from it, as in UTM's frame, a step is
    so ill-conditioned that it takes none and switches every edge off.
    """
    import open3d as o3d

    registration = o3d.pipelines.registration
    T_map_first = pose(np.eye(3), poses[0][:3, 3])
    T_first_map = inverse(T_map_first)
    graph = _open3d_graph(registration, [T_first_map @ T for T in poses], edges)
    # Open3D derives mu from a distance and the mean of information(5, 5), which it takes for a count of points.
    mean_information = float(np.mean([edge.information[5, 5] for edge in edges]))
    option = registration.GlobalOptimizationOption(
        max_correspondence_distance=float(np.sqrt(mu / mean_information)),
        edge_prune_threshold=0.0,
        preference_loop_closure=1.0,
        reference_node=0,
    )
    quiet = o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error)
    with quiet:
        registration.global_optimization(
            graph,
            registration.GlobalOptimizationLevenbergMarquardt(),
            registration.GlobalOptimizationConvergenceCriteria(),
            option,
        )
    weights = np.array([edge.confidence if edge.uncertain else 1.0 for edge in graph.edges])
    return [T_map_first @ node.pose for node in graph.nodes], weights


def _open3d_graph(registration: Any, poses: Sequence[Array], edges: Sequence[Edge]) -> Any:
    graph = registration.PoseGraph()
    for T in poses:
        graph.nodes.append(registration.PoseGraphNode(np.array(T)))
    for edge in edges:
        graph.edges.append(
            registration.PoseGraphEdge(
                edge.source, edge.target, np.array(edge.T_target_source), edge.information, edge.uncertain
            )
        )
    return graph
