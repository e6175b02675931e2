# SPDX-License-Identifier: Apache-2.0
"""A pose graph that is solved as it grows, by GTSAM's iSAM2.

Kaess et al., "iSAM2: Incremental Smoothing and Mapping Using the Bayes Tree" (2012).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from objreg_mapper.optimisation.edges import Edges
from objreg_ros.data.checked import Array

RELINEARISED = 0.05  # rad and m: a node that moves farther is linearised anew
HELD_SIGMA = 1e-2  # rad and m; how fast the first node is held moves nothing, as nothing else holds it
MOST_UPDATES = 4
FEW = 0.05  # of all nodes
PAIR = 2  # nodes
INSTALL = "expected gtsam, which solves the map, got none: pip install --no-deps gtsam (or objreg_ros[mapper])"


class MissingError(ImportError, ValueError):
    """What solves the map is not installed; a node that needs it ends with this line."""


def load() -> Any:
    """GTSAM, imported now: it takes some time, in which nothing else runs. `MissingError` where it is not installed."""
    try:
        return import_module("gtsam")
    except ImportError as error:
        raise MissingError(INSTALL) from error


class _Waiting:
    """What waits for the next update: new factors and values, and GTSAM's numbers of factors that are gone."""

    def __init__(self, gtsam: Any) -> None:
        self.factors, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self.gone: list[int] = []

    def is_nothing(self) -> bool:
        """Whether an update would change nothing: a node comes with an edge, at least."""
        return not (self.factors.size() or self.gone)


class _Tree:
    """GTSAM's iSAM2, what waits for it, and in ``places`` its numbers of the edges that are there, by ours."""

    def __init__(self, gtsam: Any, isam: Any, places: Sequence[int]) -> None:
        self._gtsam, self.isam, self.places = gtsam, isam, list(places)
        self.waiting = _Waiting(gtsam)

    @classmethod
    def begun(cls, poses: Array, edges: Sequence[Any], is_careful: bool) -> _Tree:
        """Of nodes at poses and GTSAM's factors between them, None of an edge that is gone."""
        gtsam = load()
        new, noise = _Waiting(gtsam), gtsam.noiseModel.Isotropic.Sigma(6, HELD_SIGMA)
        new.factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(poses[0]), noise))
        here = [number for number, edge in enumerate(edges) if edge is not None]
        for number in here:
            new.factors.add(edges[number])
        for k, T in enumerate(poses):
            new.values.insert(k, gtsam.Pose3(T))
        isam, places = gtsam.ISAM2(_params(gtsam, is_careful)), [-1] * len(edges)
        for number, place in zip(here, _updated(isam, new)[1:], strict=True):
            places[number] = place
        return cls(gtsam, isam, places)

    def copied(self) -> _Tree:
        """The same once more. Nothing may wait."""
        return _Tree(self._gtsam, self._gtsam.ISAM2(self.isam), self.places)

    def take_in(self) -> None:
        """Bring in what waits."""
        if not self.waiting.is_nothing():
            self.places += _updated(self.isam, self.waiting)
            self.waiting = _Waiting(self._gtsam)


def _updated(isam: Any, new: _Waiting) -> list[int]:
    """GTSAM's numbers of the new factors, once they are in."""
    return list(isam.update(new.factors, new.values, new.gone).getNewFactorsIndices())


def _params(gtsam: Any, is_careful: bool) -> Any:
    params = gtsam.ISAM2Params()
    params.setRelinearizeThreshold(RELINEARISED)
    params.relinearizeSkip = 1
    params.setFactorization("QR" if is_careful else "CHOLESKY")
    return params


class IncrementalGraph:
    """Nodes by number from 0, of which the first is held at a pose; edges by the numbers that come back for them.

    What is asked for waits for the next look at the graph, and is done at once. It is solved by Cholesky's factors, and
    by QR, which takes twice the time, from where these are too coarse: a lie that claims a micrometre among odometry of
    metres. RuntimeError where GTSAM finds no solution; the graph is of no use then.
    """

    def __init__(self, settled: Array, edges: Sequence[Any], tree: _Tree, is_careful: bool) -> None:
        self._gtsam = load()
        self._settled, self._tree, self._is_careful = settled, tree, is_careful
        self._edges = list(edges)  # GTSAM's factors, by our numbers; None of one that is gone

    @classmethod
    def begun(cls, T_map_first: Array) -> IncrementalGraph:
        """The graph of one node."""
        return cls(T_map_first[None], (), _Tree.begun(T_map_first[None], (), is_careful=False), is_careful=False)

    @property
    def count(self) -> int:
        """How many nodes there are."""
        return len(self._settled)

    def copied(self) -> IncrementalGraph:
        """The same once more, to try something on."""
        self._update()
        return IncrementalGraph(self._settled, self._edges, self._tree.copied(), self._is_careful)

    def grow(self, poses: Array, edges: Edges, gone: Sequence[int] = ()) -> list[int]:
        """Add nodes at ``poses (n, 4, 4)``, by the next numbers, and the edges that tie them; take out those gone."""
        for k, T in enumerate(poses, self.count):
            self._tree.waiting.values.insert(k, self._gtsam.Pose3(T))
        self._settled = np.concatenate([self._settled, poses])
        numbers = self.add_edges(edges)
        self.remove(gone)
        return numbers

    def add_edges(self, edges: Edges) -> list[int]:
        """Tie nodes that are there."""
        first = len(self._edges)
        for factor in self._factors(edges):
            self._edges.append(factor)
            self._tree.waiting.factors.add(factor)
        return list(range(first, len(self._edges)))

    def _factors(self, edges: Edges) -> Iterator[Any]:
        gtsam = self._gtsam
        for k1, k2, T, W in zip(edges.k1.tolist(), edges.k2.tolist(), edges.T_1_2, edges.whitening, strict=True):
            noise = gtsam.noiseModel.Gaussian.SqrtInformation(W, False)
            yield gtsam.BetweenFactorPose3(k1, k2, gtsam.Pose3(T), noise)

    def remove(self, numbers: Sequence[int]) -> None:
        """Take edges out."""
        if any(number >= len(self._tree.places) for number in numbers):
            self._update()
        for number in numbers:
            self._tree.waiting.gone.append(self._tree.places[number])
            self._edges[number] = None

    def solve_poses(self) -> Array:
        """(n, 4, 4): where the nodes are with all that waits. What moves far is linearised anew, until little does."""
        relinearised = self.count
        for _ in range(MOST_UPDATES):
            known, self._settled = self._settled, self.poses()
            if relinearised <= FEW * self.count or np.abs(self._settled - known).max() < RELINEARISED:
                return self._settled
            relinearised = self._carefully(lambda: self._tree.isam.update().getVariablesRelinearized())
        self._settled = self.poses()
        return self._settled

    def _carefully(self, work: Callable[[], Any]) -> Any:
        """What comes of work; where that fails, of doing it once more in a graph that is solved with more care."""
        try:
            return work()
        except RuntimeError:
            if self._is_careful:
                raise
        self._is_careful = True
        self._tree = _Tree.begun(self._settled, self._edges, is_careful=True)
        return work()

    def _update(self) -> None:
        self._carefully(lambda: self._tree.take_in())

    def poses(self) -> Array:
        """(n, 4, 4) of all nodes."""
        self._update()
        rows = self._gtsam.utilities.extractPose3(self._tree.isam.calculateEstimate())
        T = np.tile(np.eye(4), (len(rows), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = rows[:, :9].reshape(-1, 3, 3), rows[:, 9:]
        return T

    def error_covariance(self, edges: Edges) -> Array:
        """(6 m, 6 m): how the whitened errors [r t] of edges, in the graph or not, vary as it knows its nodes.

        All of it where the graph was linearised: elsewhere what is known well and what is not would mix.
        """
        self._update()
        ends = np.unique([edges.k1, edges.k2])
        blocks = self._carefully(lambda: self._joint_covariance(ends.tolist()))
        point, columns = self._tree.isam.getLinearizationPoint(), np.arange(6)
        J = np.zeros((6 * len(edges), 6 * len(ends)))
        for row, factor in enumerate(self._factors(edges)):
            sides = np.searchsorted(ends, factor.keys())
            J[6 * row : 6 * row + 6, (6 * sides[:, None] + columns).ravel()] = factor.linearize(point).jacobian()[0]
        return J @ blocks @ J.T

    def _joint_covariance(self, nodes: list[int]) -> Array:
        """(6 n, 6 n) of n nodes, in their order, where the graph was linearised.

        The tree has that of two at hand. For more it makes a graph of all that is between them and the root, which
        takes some five times as long as to eliminate everything else from the factors.
        """
        isam = self._tree.isam
        if len(nodes) <= PAIR or self._is_careful:
            joint = isam.jointMarginalCovariance(nodes)
            isam.deleteCachedShortcuts()  # what it keeps for the next, on all cliques up to the root
            return np.block([[joint.at(a, b) for b in nodes] for a in nodes])
        linear = isam.getFactorsUnsafe().linearize(isam.getLinearizationPoint())
        net = linear.marginalMultifrontalBayesNet(self._gtsam.Ordering(nodes))
        order = [net.at(k).firstFrontalKey() for k in range(net.size())]  # it need not be that of the nodes
        inverse = np.linalg.inv(net.matrix()[0])
        rows = (6 * np.argsort(order)[np.searchsorted(np.sort(order), nodes)][:, None] + np.arange(6)).ravel()
        return np.asarray((inverse @ inverse.T)[np.ix_(rows, rows)])
