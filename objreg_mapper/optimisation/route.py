# SPDX-License-Identifier: Apache-2.0
"""The part of a session in a graph: which of its keyframes are nodes there, and what odometry says between them."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.problem import SolvedTrajectory
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array

Row = tuple[int, int, Constraint]  # between two nodes


class Insertion(NamedTuple):
    """A new node at ``T_map_body (1, 4, 4)``, its steps, and the two nodes between which these replace the step."""

    T_map_body: Array
    steps: list[Row]
    instead_of: tuple[int, int] | None


@dataclass(frozen=True, slots=True)
class Route:
    """A session's chain, its ``keyframes`` that are nodes, in order, and the numbers of these ``nodes``."""

    chain: Chain
    keyframes: tuple[int, ...]
    nodes: tuple[int, ...]

    @classmethod
    def begun(cls, chain: Chain, node: int) -> Route:
        """That of a session whose first keyframe is a node."""
        return cls(chain, (0,), (node,))

    def grown(self, session: Session, count: int) -> Route:
        """With a chain of so many keyframes of its session."""
        return replace(self, chain=self.chain.grown(session, count))

    def corrected(self, session: Session, steady: Steady) -> Route:
        """With another steady error taken out of odometry."""
        return replace(self, chain=Chain.of(session, len(self.chain), steady))

    def node_of(self, keyframe: int) -> int:
        """The node of a keyframe that is one."""
        return self.nodes[bisect_left(self.keyframes, keyframe)]

    def missing(self, keyframe: int) -> list[int]:
        """The keyframes that have to become nodes so that one can be, in order; itself the last, if it is none."""
        found, last = list[int](), self.keyframes[-1]
        while (last := self.chain.straight_until(last)) < keyframe:
            found.append(last)
        at = bisect_left(self.keyframes, keyframe)
        return found if self.keyframes[at : at + 1] == (keyframe,) else [*found, keyframe]

    def with_node(self, keyframe: int, node: int) -> Route:
        """With a keyframe that becomes a node."""
        at = bisect_left(self.keyframes, keyframe)
        keyframes = (*self.keyframes[:at], keyframe, *self.keyframes[at:])
        return replace(self, keyframes=keyframes, nodes=(*self.nodes[:at], node, *self.nodes[at:]))

    def insertion(self, keyframe: int, node: int, poses: Array) -> Insertion:
        """What it takes to make a keyframe a node, after the last one or between two; ``poses`` are those of nodes."""
        at = bisect_left(self.keyframes, keyframe)
        near = slice(at - 1, at + 1)
        keyframes, nodes = self.keyframes[near], self.nodes[near]
        steps = [(nodes[0], node, self.chain.between(keyframes[0], keyframe))]
        steps += [(node, nodes[1], self.chain.between(keyframe, k)) for k in keyframes[1:]]
        T_map_body = self.chain.spread(keyframes, poses[[*nodes]], np.array([keyframe]))
        return Insertion(T_map_body, steps, (nodes[0], nodes[1]) if len(nodes) > 1 else None)

    def steps(self) -> list[Row]:
        """What odometry says from node to node."""
        spans = zip(self.nodes, self.nodes[1:], self.keyframes, self.keyframes[1:], strict=False)
        return [(node1, node2, self.chain.between(k1, k2)) for node1, node2, k1, k2 in spans]

    def solved(self, poses: Array) -> SolvedTrajectory:
        """Where the session is in the map; ``poses (n, 4, 4)`` are those of all nodes."""
        return SolvedTrajectory(self.chain, self.keyframes, poses[[*self.nodes]])
