# SPDX-License-Identifier: Apache-2.0
"""Objects: how many are matched, how many moved, and which proposers came to them independently."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.propose.evidence import MANY_MATCHES

SEVERAL = 2  # matched objects; fewer tell where one thing is, and not which way the camera looked at it
PROPOSERS = 2  # independent, that make up for a second object
SAME_EVIDENCE = {"centroids": "objects", "odometry": "objects"}
"""Proposers that are no evidence beside another one. The search for object poses starts from the centroids too. What
drifting odometry expects is refined to whatever the objects fit nearby, right or wrong."""


class Limits(NamedTuple):
    """What makes the objects' word sure."""

    many: int = MANY_MATCHES  # matched objects that did not all move together
    proposers: int = PROPOSERS  # independent proposers that make up for a second object
    silhouette_score: float = 0.0  # least of several matched objects, even a little aside


class Objects(NamedTuple):
    """What the matched objects are worth as evidence."""

    matched: int  # object pairs that lie upon each other under the pose
    few: bool  # so few that they may have moved together
    few_proposers: bool  # too few independent proposers came to the pose
    inconsistent: bool  # several are matched, and their silhouettes differ

    @property
    def lone(self) -> bool:
        """Whether no second object and too few proposers confirm the pose."""
        return self.matched < SEVERAL and self.few_proposers

    @property
    def doubtful(self) -> bool:
        """Whether the free space must decide: one object is matched, or several that are inconsistent."""
        return self.matched < SEVERAL or self.inconsistent

    @property
    def uncertain(self) -> bool:
        """Whether several objects hold the pose badly.

        They are inconsistent, or few objects come from too few proposers: from afar they hold the position, and not
        the turn.
        """
        return self.inconsistent or (self.matched >= SEVERAL and self.few and self.few_proposers)


def objects_of(candidate: Candidate, limits: Limits) -> Objects:
    """What the matched objects of a candidate are worth."""
    matched = len(candidate.matched)
    return Objects(
        matched=matched,
        few=matched < limits.many,
        few_proposers=independent(candidate.agreeing_proposers) < limits.proposers,
        inconsistent=are_inconsistent(matched, candidate.silhouette_score_nearby, limits.silhouette_score),
    )


def independent(proposers: Iterable[str]) -> int:
    """How many independent proposers are among ``proposers``."""
    return len({SAME_EVIDENCE.get(proposer, proposer) for proposer in proposers})


def are_inconsistent(matched: int, silhouette_score_nearby: float | None, least: float) -> bool:
    """Whether several objects have another silhouette, even a little aside: they stand where others stood.

    A lone object is not given that much: aside, a small thing meets nothing, and its silhouette neither agrees nor
    differs.
    """
    score = silhouette_score_nearby
    return matched >= SEVERAL and score is not None and score < least


def check_moved(matched: int, moved: int) -> Refusal | None:
    """Refuse a pose under which more objects moved than stayed: nothing is known then."""
    if moved <= matched:
        return None
    return Reason.MOVED, f"{moved} objects moved, {matched} stayed"


def check_matched(matched: int) -> Refusal | None:
    """Refuse a pose without a matched object: rooms that repeat themselves look the same."""
    return (Reason.FEW_OBJECTS, "0 objects < 1") if matched == 0 else None
