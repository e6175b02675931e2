# SPDX-License-Identifier: Apache-2.0
"""Edges of a pose graph in arrays, and how far poses are from what they say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_mapper.constraint import Constraint, local_covariance, rotation_first, rotation_vectors
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses

LEAST_FREEDOM = 1e-9  # of errors that go together: rounding must not make them more than one


@dataclass(frozen=True, slots=True)
class Edges:
    """``T_1_2 (m, 4, 4)`` between nodes ``k1 (m,)`` and ``k2 (m,)``, and the ``whitening (m, 6, 6)`` of their errors.

    The error [r t] is that of ``T_1_2^-1`` times what poses say, in the axes of *2*. Whitened it is in standard
    deviations. Both are GTSAM's order and axes.
    """

    k1: Array
    k2: Array
    T_1_2: Array
    whitening: Array

    def __len__(self) -> int:
        return len(self.k1)

    def taken(self, which: Array | slice) -> Edges:
        """Those of these numbers, or of this mask."""
        return Edges(self.k1[which], self.k2[which], self.T_1_2[which], self.whitening[which])

    def joined(self, more: Edges) -> Edges:
        """These, and then those."""
        parts = ((self.k1, more.k1), (self.k2, more.k2), (self.T_1_2, more.T_1_2), (self.whitening, more.whitening))
        return Edges(*(np.concatenate(pair) for pair in parts))


def edges_of(rows: Sequence[tuple[int, int, Constraint]]) -> Edges:
    """The arrays of constraints between nodes."""
    k1, k2 = (np.array([row[side] for row in rows], int) for side in (0, 1))
    T_1_2 = np.array([row[2].T_from_to for row in rows]).reshape(-1, 4, 4)
    covariances = np.array([rotation_first(local_covariance(row[2])) for row in rows]).reshape(-1, 6, 6)
    return Edges(k1, k2, T_1_2, _whitenings(covariances))


def _whitenings(covariances: Array) -> Array:
    """(m, 6, 6) W with ``W C W^T = 1``, through correlations: what is known to microns and to kilometres goes too."""
    sigmas = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    correlations = covariances / (sigmas[:, :, None] * sigmas[:, None, :]) + LEAST_FREEDOM * np.eye(6)
    return np.linalg.inv(np.linalg.cholesky(correlations)) / sigmas[:, None, :]


def whitened_errors(poses: Array, edges: Edges) -> Array:
    """(m, 6): how far ``poses (n, 4, 4)`` are from what each edge says, in standard deviations."""
    error = inverses(edges.T_1_2) @ inverses(poses[edges.k1]) @ poses[edges.k2]
    turns = rotation_vectors(error[:, :3, :3])
    return np.einsum("mij,mj->mi", edges.whitening, np.hstack([turns, error[:, :3, 3]]))


def squared_residuals(poses: Array, edges: Edges) -> Array:
    """(m,): the squares of the same, summed up."""
    return np.square(whitened_errors(poses, edges)).sum(axis=1)
