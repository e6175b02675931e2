# SPDX-License-Identifier: Apache-2.0
"""What a closure would be expected to cost, were others not in the map, to first order and without solving it anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from objreg_mapper.optimisation.edges import Edges, whitened_errors
from objreg_mapper.optimisation.incremental import IncrementalGraph
from objreg_ros.data.checked import Array

LEAST_HELD = 1e-6  # of an error, by all but the closures that are less: below it a quotient would be of rounding


class Influence:
    """Of closures on each other, by their ``numbers``, in a solved graph.

    One pass over the graph finds all of it: that of forty nodes takes no more than twice as long as that of two.
    """

    def __init__(self, numbers: Sequence[int], errors: Array, covariance: Array) -> None:
        self._at = {number: place for place, number in enumerate(numbers)}
        self._errors, self._covariance = errors, covariance

    @classmethod
    def of(cls, graph: IncrementalGraph, poses: Array, closures: Edges, numbers: Sequence[int]) -> Influence:
        """In a graph with its nodes at ``poses (n, 4, 4)``."""
        edges = closures.taken(np.array(numbers, int))
        return cls(numbers, whitened_errors(poses, edges), graph.error_covariance(edges))

    def changed(self, poses: Array, closures: Edges, into: Sequence[int], out: Sequence[int]) -> Influence | None:
        """That in a graph with some closures more and some less, solved with its nodes at ``poses``.

        Its covariance is ``P - P J^T (S + J P J^T)^-1 J P`` with S of 1 for those more and -1 for those less. None
        where one of them is not known here, or where those less alone hold something: that leaves little to divide by.
        """
        if not self.knows([*into, *out]):
            return None
        g, rows, M = self._rows(out), self._rows([*into, *out]), self._covariance
        if len(g) and np.linalg.eigvalsh(np.eye(len(g)) - M[np.ix_(g, g)])[0] < LEAST_HELD:
            return None
        signs = np.repeat([1.0, -1.0], [6 * len(into), 6 * len(out)])
        gain = np.linalg.solve(np.diag(signs) + M[np.ix_(rows, rows)], M[rows])
        errors = whitened_errors(poses, closures.taken(np.array([*self._at], int)))
        return Influence([*self._at], errors, M - M[:, rows] @ gain)

    def knows(self, numbers: Sequence[int]) -> bool:
        """Whether it is of all of these closures."""
        return all(number in self._at for number in numbers)

    def expected_cost(self, number: int, gone: Sequence[int] = ()) -> float:
        """What it is expected to cost to believe a closure that is not in the graph, without those that are ``gone``.

        Without them the solution moves by ``P J^T (1 - J P J^T)^-1 w``, and its covariance ``P`` grows alike: ``w`` and
        ``J`` are their whitened errors and what these change with.
        """
        n, g = self._rows([number]), self._rows(gone)
        M = self._covariance
        gain = np.linalg.solve(np.eye(len(g)) - M[np.ix_(g, g)], M[np.ix_(g, n)]).T
        error = self._errors.ravel()[n] + gain @ self._errors.ravel()[g]
        covariance = np.eye(6) + M[np.ix_(n, n)] + gain @ M[np.ix_(g, n)]
        return float(error @ np.linalg.solve(covariance, error))

    def relief(self, gone: Sequence[int]) -> float:
        """By how much all else, and they themselves, would cost less without closures that are in the graph."""
        g = self._rows(gone)
        w = self._errors.ravel()[g]
        return float(w @ np.linalg.solve(np.eye(len(g)) - self._covariance[np.ix_(g, g)], w))

    def _rows(self, numbers: Sequence[int]) -> Array:
        return np.array([6 * self._at[number] + k for number in numbers for k in range(6)], int)
