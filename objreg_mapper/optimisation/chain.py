# SPDX-License-Identifier: Apache-2.0
"""Odometry from keyframe to keyframe as one chain: what it says between any two of them, and how they share an error.

Each step errs alike in all axes, by a variance of position and one of rotation. So sums over the steps are enough to
know the covariance between any two keyframes, however far apart, and a graph needs no node in between. What the map
moves a later keyframe by is shared among those before as least squares would: by their covariance with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_mapper.constraint import Constraint, rotation_vectors
from objreg_mapper.optimisation.steady import Steady, corrected_steps
from objreg_mapper.session import Session, stacked
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses, rotation_from_vector, skew

AT_ONCE = 4000  # keyframes that are spread together: each takes some 2 kB meanwhile
STRAIGHT_RAD = 0.06  # one sigma: what an error that is shared by first order may turn by


@dataclass(frozen=True, slots=True)
class Chain:
    """``T_chain_body (n, 4, 4)`` of keyframes, with what is ``steady`` in odometry's error taken out.

    ``sums`` are those of the errors of its steps, whose variances are those of position and rotation, m^2 and rad^2 in
    every axis.
    """

    steady: Steady
    T_chain_body: Array
    sums: tuple[Array, ...]

    @classmethod
    def begun(cls, T_odom_first: Array, steady: Steady) -> Chain:
        """The chain of one keyframe."""
        sums = np.zeros((1,)), np.zeros((1,)), np.zeros((1, 3)), np.zeros((1, 3, 3))
        return cls(steady, T_odom_first[None].copy(), sums)

    @classmethod
    def of(cls, session: Session, count: int, steady: Steady) -> Chain:
        """The chain of the first keyframes of a session."""
        return cls.begun(session.keyframes.poses[0], steady).grown(session, count)

    def __len__(self) -> int:
        return len(self.T_chain_body)

    def grown(self, session: Session, count: int) -> Chain:
        """With those of the first ``count`` keyframes of its session that are not there yet."""
        begin = len(self)
        if count <= begin:
            return self
        variances = np.array(session.variances[begin - 1 : count - 1]).reshape(-1, 2)
        return self.extended(stacked(session.keyframes.poses[begin - 1 : count]), variances)

    def extended(self, T_odom_body: Array, variances: Array) -> Chain:
        """With more keyframes: poses (m + 1, 4, 4) of odometry, the newest that is here first, and variances (m, 2)."""
        poses = [self.T_chain_body[-1]]
        for step in corrected_steps(T_odom_body, self.steady):
            poses.append(poses[-1] @ step)
        new = np.array(poses[1:]).reshape(-1, 4, 4)
        a, b = variances.T
        p = new[:, :3, 3] - self.T_chain_body[0, :3, 3]
        parts = a, b, b[:, None] * p, b[:, None, None] * p[:, :, None] * p[:, None, :]
        grown = zip(self.sums, parts, strict=True)
        sums = tuple(np.concatenate([old, old[-1] + np.cumsum(part, axis=0)]) for old, part in grown)
        return Chain(self.steady, np.concatenate([self.T_chain_body, new]), sums)

    def between(self, k1: int, k2: int) -> Constraint:
        """What odometry says between two keyframes, the earlier one first."""
        T_1_2 = inverses(self.T_chain_body[k1 : k1 + 1])[0] @ self.T_chain_body[k2]
        J = np.kron(np.eye(2), self.T_chain_body[k1, :3, :3].T)
        return Constraint(T_1_2, J @ self._covariances(np.array([k1]), np.array([k2]))[0] @ J.T)

    def motions(self, k1: Array, k2: Array) -> tuple[Array, Array]:
        """What odometry says from keyframes to others that are no earlier: poses (m, 4, 4) and the (m, 6, 6) of [t r].

        These are of the errors in the axes of the later ones.
        """
        J = np.kron(np.eye(2), self.T_chain_body[k2, :3, :3].transpose(0, 2, 1))
        C = J @ self._covariances(k1, k2) @ J.transpose(0, 2, 1)
        return inverses(self.T_chain_body[k1]) @ self.T_chain_body[k2], C

    def straight_until(self, k1: int) -> int:
        """The last keyframe until which odometry has not turned far enough to matter; the next one at least."""
        return max(int(np.searchsorted(self.sums[1], self.sums[1][k1] + STRAIGHT_RAD**2, side="right")) - 1, k1 + 1)

    def spread(self, nodes: Sequence[int], T_map_body: Array, keyframes: Array | None = None) -> Array:
        """(m, 4, 4): keyframes in the map, all of them if None, from where it has those of ``nodes``, which increase.

        The conditional mean of each, given the next node; what is before the first and after the last is carried along.
        """
        wanted, known = np.arange(len(self)) if keyframes is None else keyframes, np.asarray(nodes)
        T = np.empty((len(wanted), 4, 4))
        for begin in range(0, len(wanted), AT_ONCE):
            part = slice(begin, begin + AT_ONCE)
            T[part] = self._spread(known, T_map_body, wanted[part])
        return T

    def _spread(self, nodes: Array, T_map_body: Array, wanted: Array) -> Array:
        at = np.clip(np.searchsorted(nodes, wanted, side="right") - 1, 0, len(nodes) - 1)
        k1 = nodes[at]
        T_map_chain = T_map_body[at] @ inverses(self.T_chain_body[k1])
        local = self.T_chain_body[wanted].copy()
        inside = np.flatnonzero((wanted > k1) & (at < len(nodes) - 1))
        if len(inside):
            at, k2 = at[inside], nodes[at[inside] + 1]
            target = inverses(T_map_chain[inside]) @ T_map_body[at + 1]
            local[inside] = self._shared(k1[inside], wanted[inside], k2, target)
        return T_map_chain @ local

    def _shared(self, k1: Array, k: Array, k2: Array, target: Array) -> Array:
        """(m, 4, 4): keyframes ``k`` in the chain's frame, once ``k2`` is at a target there and ``k1`` stays."""
        here, end = self.T_chain_body[k], self.T_chain_body[k2]
        turn = rotation_vectors(target[:, :3, :3] @ end[:, :3, :3].transpose(0, 2, 1))
        error = np.hstack([target[:, :3, 3] - end[:, :3, 3], turn])
        share = np.linalg.solve(self._covariances(k1, k2), error[:, :, None])[:, :, 0]
        lever = end[:, :3, 3] - here[:, :3, 3]  # what has come up at a keyframe turns the end about it
        share[:, 3:] += np.cross(lever, share[:, :3])
        moved = np.einsum("mij,mj->mi", self._covariances(k1, k), share)
        T = here.copy()
        T[:, :3, 3] += moved[:, :3]
        T[:, :3, :3] = rotation_from_vector(moved[:, 3:]) @ here[:, :3, :3]
        return T

    def _covariances(self, k1: Array, k2: Array) -> Array:
        """(m, 6, 6) of the errors [t r] that come up from keyframes to later ones, there and in the axes of the chain.

        A step turns what follows about where it ends: ``t = sum(t_s + r_s x (p - p_s))``.
        """
        a, b, bp, bpp = (total[k2] - total[k1] for total in self.sums)
        p = self.T_chain_body[k2, :3, 3] - self.T_chain_body[0, :3, 3]
        mixed = bp[:, :, None] * p[:, None, :]
        M = b[:, None, None] * p[:, :, None] * p[:, None, :] - mixed - mixed.transpose(0, 2, 1) + bpp
        levers = skew(b[:, None] * p - bp)
        C = np.zeros((len(p), 6, 6))
        C[:, :3, :3] = (a + np.trace(M, axis1=1, axis2=2))[:, None, None] * np.eye(3) - M
        C[:, 3:, 3:] = b[:, None, None] * np.eye(3)
        C[:, :3, 3:], C[:, 3:, :3] = -levers, levers
        return C
