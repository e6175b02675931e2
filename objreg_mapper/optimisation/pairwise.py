# SPDX-License-Identifier: Apache-2.0
"""The most closures of which each agrees with each other: Mangelson et al., "Pairwise Consistent Measurement Set
Maximization for Robust Multi-Robot Map Merging" (2018).

Two closures between the same two sessions make a cycle with what odometry says from the end of the one to that of the
other. They agree where the cycle closes as well as their covariances and odometry's let expect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from objreg_mapper.constraint import inverted, local_covariance, rotation_vectors
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.session import stacked
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses, skew

if TYPE_CHECKING:
    from objreg_mapper.optimisation.problem import Tie

LIMIT = 16.81  # what one pair in a hundred that agrees exceeds: chi-squared of six freedoms
MOST_PAIRS = 300  # with so many closures before it each is compared
MOST_BEGUN = 30  # closures from which the most that agree are looked for


class Agreement:
    """Closures between two sessions, which may be one, and who agrees with whom."""

    def __init__(self) -> None:
        self._numbers: list[int] = []
        self._ties: list[Tie] = []
        self._agree = np.zeros((0, 0), bool)

    def add_tie(self, number: int, tie: Tie, chains: tuple[Chain, Chain]) -> None:
        """Take in one more; chains are those of the sessions of its two ends."""
        count, first = len(self._ties), max(len(self._ties) - MOST_PAIRS, 0)
        grown = np.ones((count + 1, count + 1), bool)  # what is not compared does not disagree
        grown[:count, :count] = self._agree
        grown[first:count, count] = grown[count, first:count] = agreeing(tie, self._ties[first:], chains)
        self._numbers.append(number)
        self._ties.append(tie)
        self._agree = grown

    def outside(self) -> list[int]:
        """The numbers of those that are not among the most that agree."""
        inside = set(most_agreeing(self._agree))
        return [number for k, number in enumerate(self._numbers) if k not in inside]


class PairwiseConsistency:
    """Who agrees with whom among all closures of a map."""

    def __init__(self) -> None:
        self._taken = 0
        self._agreements: dict[tuple[int, int], Agreement] = {}

    def inconsistent(self, ties: Sequence[Tie], chains: Mapping[int, Chain]) -> frozenset[int]:
        """The numbers of ties that are not among the most between their sessions of which each agrees with each.

        ``chains`` are those of their sessions.
        """
        for number in range(self._taken, len(ties)):
            tie = in_order(ties[number])
            ends = tie.end1.session, tie.end2.session
            of_ends = chains[ends[0]], chains[ends[1]]
            self._agreements.setdefault(ends, Agreement()).add_tie(number, tie, of_ends)
        self._taken = len(ties)
        return frozenset(number for one in self._agreements.values() for number in one.outside())


def in_order(tie: Tie) -> Tie:
    """The tie from the session of the lower number."""
    if tie.end1.session <= tie.end2.session:
        return tie
    return tie._replace(end1=tie.end2, end2=tie.end1, constraint=inverted(tie.constraint))


def agreeing(one: Tie, others: Sequence[Tie], chains: tuple[Chain, Chain]) -> Array:
    """(m,) of bool: whether the cycle of a tie with each of others closes within what is expected of it.

    From the first end of the one by odometry to that of the other, by that to its second, and by odometry back. The
    error of a step is in the axes of its end, and what follows carries it on.
    """
    ties = [one, *others]
    T = stacked([tie.constraint.T_from_to for tie in ties])
    C = np.array([local_covariance(tie.constraint) for tie in ties])
    k1, k2 = (np.array([end.keyframe for end in ends]) for ends in zip(*(tie[:2] for tie in ties), strict=True))
    out, C_out = said(chains[0], np.repeat(k1[0], len(others)), k1[1:])
    back, C_back = said(chains[1], k2[1:], np.repeat(k2[0], len(others)))
    around = out @ T[1:] @ back
    carried = adjoints(inverses(T[1:] @ back)), adjoints(inverses(back))
    spread = (
        C[0] + C_back + sum(J @ part @ J.transpose(0, 2, 1) for J, part in zip(carried, (C_out, C[1:]), strict=True))
    )
    apart = inverses(T[:1]) @ around
    error = np.hstack([apart[:, :3, 3], rotation_vectors(apart[:, :3, :3])])
    return np.asarray(np.einsum("mi,mi->m", error, np.linalg.solve(spread, error[:, :, None])[:, :, 0]) <= LIMIT)


def said(chain: Chain, k1: Array, k2: Array) -> tuple[Array, Array]:
    """What odometry says between keyframes in any order: poses (m, 4, 4), and (m, 6, 6) of [t r] in the axes of *2*."""
    first, last = np.minimum(k1, k2), np.maximum(k1, k2)
    T, C = chain.motions(first, last)
    is_back = (k1 > k2)[:, None, None]
    J = adjoints(T)
    return np.where(is_back, inverses(T), T), np.where(is_back, J @ C @ J.transpose(0, 2, 1), C)


def adjoints(T: Array) -> Array:
    """(m, 6, 6) of poses (m, 4, 4): what a motion [t r] in the axes of *to* is in those of *from*."""
    R = T[:, :3, :3]
    J = np.zeros((len(T), 6, 6))
    J[:, :3, :3] = J[:, 3:, 3:] = R
    J[:, :3, 3:] = skew(T[:, :3, 3]) @ R
    return J


def most_agreeing(agree: Array) -> list[int]:
    """The most of which each agrees with each, of (n, n) bool with True on the diagonal: nearly always, as it is a
    heuristic.

    From each of those that agree with most, whoever agrees with most of those left is taken in (Pattabiraman et al.,
    "Fast Algorithms for the Maximum Clique Problem on Massive Graphs", 2015).
    """
    best: list[int] = []
    degrees = agree.sum(axis=1)
    for begin in np.argsort(-degrees, kind="stable")[:MOST_BEGUN].tolist():
        if degrees[begin] <= len(best):
            break
        inside, left = [begin], agree[begin].copy()
        left[begin] = False
        counts = agree[:, left].sum(axis=1)
        while left.any() and len(inside) + int(left.sum()) > len(best):
            chosen = int(np.where(left, counts, -1).argmax())
            inside.append(chosen)
            gone = left & ~agree[chosen]
            gone[chosen] = True
            left &= ~gone
            counts -= agree[:, gone].sum(axis=1)
        if len(inside) > len(best):
            best = inside
    return sorted(best)
