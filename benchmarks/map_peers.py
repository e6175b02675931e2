# SPDX-License-Identifier: Apache-2.0
"""Other optimisers on the graph that the mapper has: every keyframe a node, the same steps, closures and limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gtsam
import numpy as np

from objreg_mapper.constraint import EXACT, freed
from objreg_mapper.optimisation.edges import Edges, edges_of, squared_residuals
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose

HELD_SIGMA = 1e-6  # rad and m: the first node stays
STAGE = 4.0  # Open3D's doubt shrinks by this factor from call to call
SWITCHED_OFF = 0.25  # the weight of a closure at the limit
HALF = 0.5  # GTSAM's GNC gives weights of almost 0 and almost 1


class Dense(NamedTuple):
    """``poses (n, 4, 4)`` of one session's keyframes as odometry has them, and what ties them."""

    poses: Array
    steps: Edges
    closures: Edges

    @classmethod
    def of(cls, graph: PoseGraph, picture_sigmas: tuple[float, float] = EXACT) -> Dense:
        """What a mapper with one session has: closures that it refused as implausible are not among them.

        These are known less well by how far pictures are from their keyframes, m and rad.
        """
        rows = [(tie.end1.keyframe, tie.end2.keyframe, tie.constraint) for tie in graph.ties]
        first = len(graph.keyframes) - 1
        closures = [(k1, k2, freed(constraint, picture_sigmas)) for k1, k2, constraint in rows[first:]]
        return cls(np.array(graph.keyframes.poses), edges_of(rows[:first]), edges_of(closures))

    def between_pictures(self, offset: int) -> Dense:
        """The same with closures between other nodes, whose numbers are higher by an offset."""
        edges = self.closures
        return self._replace(closures=Edges(edges.k1 + offset, edges.k2 + offset, edges.T_1_2, edges.whitening))


class Solved(NamedTuple):
    """``poses (n, 4, 4)``, and which closures (m,) an optimiser ``kept``."""

    poses: Array
    kept: Array


def levenberg_marquardt(dense: Dense, _: float) -> Solved:
    """GTSAM's, which believes every closure."""
    factors, values = factors_of(dense), values_of(dense.poses)
    found = gtsam.LevenbergMarquardtOptimizer(factors, values).optimize()
    return Solved(poses_of(found, len(dense.poses)), np.ones(len(dense.closures), bool))


def graduated_non_convexity(dense: Dense, limit: float) -> Solved:
    """GTSAM's with truncated least squares; the steps are known to be right, ``limit`` is in standard deviations."""
    factors, values = factors_of(dense), values_of(dense.poses)
    params = gtsam.GncLMParams()
    params.setLossType(gtsam.GncLossType.TLS)
    params.setKnownInliers(list(range(1 + len(dense.steps))))
    optimizer = gtsam.GncLMOptimizer(factors, values, params)
    optimizer.setInlierCostThresholds(0.5 * limit**2)
    found = optimizer.optimize()
    weights = np.asarray(optimizer.getWeights())[1 + len(dense.steps) :]
    return Solved(poses_of(found, len(dense.poses)), weights > HALF)


def open3d_line_processes(dense: Dense, limit: float) -> Solved:
    """Open3D's global optimisation, with less doubt from call to call, and at last without what it switched off."""
    poses, kept = dense.poses, np.ones(len(dense.closures), bool)
    largest = squared_residuals(poses, dense.closures).max(initial=0.0)
    count = int(np.ceil(np.log(max(largest / limit**2, 1.0)) / np.log(STAGE)))
    for k in range(count, -1, -1):
        poses, weights = _open3d(poses, dense.steps, dense.closures, limit**2 * STAGE**k)
        kept = weights >= SWITCHED_OFF
    if not kept.all():
        poses, _ = _open3d(poses, dense.steps, dense.closures.taken(kept), limit**2)
    return Solved(poses, kept)


Peer = Callable[[Dense, float], Solved]
PEERS: dict[str, Peer] = {
    "Open3D": open3d_line_processes,
    "GTSAM LM": levenberg_marquardt,
    "GTSAM GNC": graduated_non_convexity,
}


def _open3d(poses: Array, steps: Edges, closures: Edges, mu: float) -> tuple[Array, Array]:
    """Poses and the weights of closures by one call; about the first node, as Open3D turns poses about the origin."""
    import open3d as o3d

    registration = o3d.pipelines.registration
    T_map_first = pose(np.eye(3), poses[0][:3, 3])
    graph = registration.PoseGraph()
    for T in inverse(T_map_first) @ poses:
        graph.nodes.append(registration.PoseGraphNode(T))
    information = []
    for edges, uncertain in ((steps, False), (closures, True)):
        for a, b, T, W in zip(edges.k1.tolist(), edges.k2.tolist(), edges.T_1_2, edges.whitening, strict=True):
            information.append(W.T @ W)  # rotation first, in the axes of *2*: Open3D's too
            graph.edges.append(registration.PoseGraphEdge(b, a, T, information[-1], uncertain))
    # Open3D derives mu from a distance and the mean of information(5, 5), which it takes for a count of points.
    distance = float(np.sqrt(mu / np.mean([one[5, 5] for one in information])))
    option = registration.GlobalOptimizationOption(
        max_correspondence_distance=distance, edge_prune_threshold=0.0, preference_loop_closure=1.0, reference_node=0
    )
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        registration.global_optimization(
            graph,
            registration.GlobalOptimizationLevenbergMarquardt(),
            registration.GlobalOptimizationConvergenceCriteria(),
            option,
        )
    weights = np.array([edge.confidence for edge in list(graph.edges)[len(steps) :]])
    return np.array([T_map_first @ node.pose for node in graph.nodes]), weights


def factors_of(dense: Dense) -> Any:
    """GTSAM's graph: what holds the first node, then the steps, then the closures."""
    factors = gtsam.NonlinearFactorGraph()
    held = gtsam.noiseModel.Isotropic.Sigma(6, HELD_SIGMA)
    factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(dense.poses[0]), held))
    for edges in (dense.steps, dense.closures):
        for a, b, T, W in zip(edges.k1.tolist(), edges.k2.tolist(), edges.T_1_2, edges.whitening, strict=True):
            noise = gtsam.noiseModel.Gaussian.SqrtInformation(W, False)
            factors.add(gtsam.BetweenFactorPose3(a, b, gtsam.Pose3(T), noise))
    return factors


def values_of(poses: Array) -> Any:
    """GTSAM's values of poses (n, 4, 4)."""
    values = gtsam.Values()
    for k, T in enumerate(poses):
        values.insert(k, gtsam.Pose3(T))
    return values


def poses_of(values: Any, count: int) -> Array:
    """The poses (n, 4, 4) in GTSAM's values."""
    return np.array([values.atPose3(k).matrix() for k in range(count)])


def chosen(names: str) -> Sequence[str]:
    """The peers of a comma-separated list; ValueError for one that there is not."""
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    unknown = [name for name in wanted if name not in PEERS]
    if unknown:
        raise ValueError(f"expected peers of {', '.join(PEERS)}, got {', '.join(unknown)}")
    return wanted
