# SPDX-License-Identifier: Apache-2.0
"""The most closures of which each agrees with each other: Mangelson et al., "Pairwise Consistent Measurement Set
Maximization for Robust Multi-Robot Map Merging" (2018).

Two closures between the same two sessions make a cycle with what odometry says from the end of the one to that of the
other. They agree where the cycle closes as well as their covariances and odometry's let expect.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse, vector_from_rotation
from objreg_ros.mapper.chain import Chain
from objreg_ros.mapper.constraint import Constraint, followed, inverted, local_covariance
from objreg_ros.mapper.session import Session, stacked
from objreg_ros.mapper.steady import Steady

if TYPE_CHECKING:
    from objreg_ros.mapper.solver import Tie

LIMIT = 16.81  # what one pair in a hundred that agrees exceeds: chi-squared of six freedoms
MOST_PAIRS = 300  # with so many closures before it each is compared
MOST_BEGUN = 30  # closures from which the most that agree are looked for


class Agreement:
    """Closures between two sessions, which may be one, and who agrees with whom."""

    def __init__(self) -> None:
        self._numbers: list[int] = []
        self._ties: list[Tie] = []
        self._agree = np.zeros((0, 0), bool)

    def add(self, number: int, tie: Tie, chains: tuple[Chain, Chain]) -> None:
        """Take in one more; chains are those of the sessions of its two ends."""
        count, first = len(self._ties), max(len(self._ties) - MOST_PAIRS, 0)
        grown = np.ones((count + 1, count + 1), bool)  # what is not compared does not disagree
        grown[:count, :count] = self._agree
        for k in range(first, count):
            grown[k, count] = grown[count, k] = agrees(self._ties[k], tie, chains)
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
        self._chains: dict[int, Chain] = {}
        self._agreements: dict[tuple[int, int], Agreement] = {}

    def inconsistent(self, ties: Sequence[Tie], sessions: Sequence[Session]) -> frozenset[int]:
        """The numbers of ties that are not among the most between their sessions of which each agrees with each."""
        for number in range(self._taken, len(ties)):
            tie = in_order(ties[number])
            ends = tie.end1.session, tie.end2.session
            chains = self._chain(ends[0], sessions), self._chain(ends[1], sessions)
            self._agreements.setdefault(ends, Agreement()).add(number, tie, chains)
        self._taken = len(ties)
        return frozenset(number for one in self._agreements.values() for number in one.outside())

    def _chain(self, number: int, sessions: Sequence[Session]) -> Chain:
        session = sessions[number]
        if number not in self._chains:
            self._chains[number] = Chain(session.keyframes.poses[0], Steady())
        chain, count = self._chains[number], len(session.keyframes)
        begin = len(chain)
        if count > begin:
            variances = np.array(session.variances[begin - 1 : count - 1]).reshape(-1, 2)
            chain.extend(stacked(session.keyframes.poses[begin - 1 : count]), variances)
        return chain


def in_order(tie: Tie) -> Tie:
    """The tie from the session of the lower number."""
    if tie.end1.session <= tie.end2.session:
        return tie
    return tie._replace(end1=tie.end2, end2=tie.end1, constraint=inverted(tie.constraint))


def agrees(one: Tie, other: Tie, chains: tuple[Chain, Chain]) -> bool:
    """Whether the cycle of two ties of the same sessions closes within what is expected of it."""
    out = said(chains[0], one.end1.keyframe, other.end1.keyframe)
    back = said(chains[1], other.end2.keyframe, one.end2.keyframe)
    around = followed(followed(out, other.constraint), back)
    T = inverse(one.constraint.T_from_to) @ around.T_from_to
    error = np.concatenate([T[:3, 3], vector_from_rotation(T[:3, :3])])
    covariance = local_covariance(one.constraint) + local_covariance(around)
    return bool(error @ np.linalg.solve(covariance, error) <= LIMIT)


def said(chain: Chain, k1: int, k2: int) -> Constraint:
    """What odometry says between two keyframes in any order."""
    if k1 == k2:
        return Constraint(np.eye(4), np.zeros((6, 6)))
    return chain.between(k1, k2) if k1 < k2 else inverted(chain.between(k2, k1))


def most_agreeing(agree: Array) -> list[int]:
    """The most of which each agrees with each, of (n, n) bool with True on the diagonal: nearly always, as it is a
    heuristic.

    From each of those that agree with most, whoever agrees with most of those left is taken in (Pattabiraman et al.,
    "Fast Algorithms for the Maximum Clique Problem on Massive Graphs", 2015).
    """
    best = np.zeros(0, int)
    for begin in np.argsort(-agree.sum(axis=1), kind="stable")[:MOST_BEGUN].tolist():
        inside, left = [begin], agree[begin].copy()
        left[begin] = False
        while left.any() and len(inside) + int(left.sum()) > len(best):
            choices = np.flatnonzero(left)
            chosen = int(choices[agree[np.ix_(choices, choices)].sum(axis=1).argmax()])
            inside.append(chosen)
            left &= agree[chosen]
            left[chosen] = False
        if len(inside) > len(best):
            best = np.array(inside)
    return sorted(best.tolist())
