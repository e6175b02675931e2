# SPDX-License-Identifier: Apache-2.0
"""Where a session is in the map, once closures to sessions that are there agree on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from objreg_mapper.constraint import inverted
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.problem import End, Tie
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses

TIES, MOST_VOTES = 2, 100  # closures that have to agree on where a session is in the map, of the newest so many
AGREEING_M, AGREEING_SHARE = 0.3, 0.05  # how far they may be from that, and with every metre of odometry between them
FindPlace = Callable[[End], Array | None]  # T_map_body of a keyframe; None of one whose session is not in the map


class Vote(NamedTuple):
    """A closure's: a keyframe of the session is at ``T_map_body``."""

    keyframe: int
    T_map_body: Array


def votes_on(session: int, ties: Sequence[Tie], find_place: FindPlace) -> list[Vote]:
    """Those of the newest closures that tie a session to the map."""
    outward = [_outward(tie, session) for tie in ties[-MOST_VOTES:]]
    placed = [(tie, find_place(tie.end1)) for tie in outward if tie.end2.session == session]
    return [Vote(tie.end2.keyframe, T @ tie.constraint.T_from_to) for tie, T in placed if T is not None]


def _outward(tie: Tie, session: int) -> Tie:
    """The tie, with its second end in the session if it has one there."""
    if tie.end1.session != session:
        return tie
    return tie._replace(end1=tie.end2, end2=tie.end1, constraint=inverted(tie.constraint))


def place_of(session: Session, chain: Chain, votes: Sequence[Vote]) -> Array | None:
    """``T_map_first (4, 4)`` of a session as most votes have it, if `TIES` agree; None else."""
    if len(votes) < TIES:
        return None
    ends, T_map_end = [vote.keyframe for vote in votes], np.array([vote.T_map_body for vote in votes])
    T_chain_end = chain.T_chain_body[ends]
    T_map_chain = T_map_end @ inverses(T_chain_end)
    expected = T_map_chain[:, None] @ T_chain_end[None]
    apart = np.linalg.norm(expected[..., :3, 3] - T_map_end[None, :, :3, 3], axis=2)
    ways = np.array([[session.path_m(a, b) for b in ends] for a in ends])
    counts = (np.maximum(apart, apart.T) < AGREEING_M + AGREEING_SHARE * ways).sum(axis=1)
    best = int(counts.argmax())
    return np.asarray(T_map_chain[best] @ chain.T_chain_body[0]) if counts[best] >= TIES else None
