# SPDX-License-Identifier: Apache-2.0
"""Objects: how many are matched, how many moved, and which proposers came to them independently."""

from __future__ import annotations

from collections.abc import Iterable

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.refusal import Refusal

SEVERAL = 2  # matched objects; fewer tell where one thing is, and not which way the camera looked at it
PROPOSERS = 2  # independent, that make up for a second object
SAME_EVIDENCE = {"centroids": "objects", "odometry": "objects"}
"""Proposers that are no evidence beside another one. The search for object poses starts from the centroids too. What
drifting odometry expects is refined to whatever the objects fit nearby, right or wrong."""


def is_lone(candidate: Candidate) -> bool:
    """Whether no second object and too few independent proposers confirm the pose."""
    return len(candidate.matched) < SEVERAL and independent(candidate.agreeing_proposers) < PROPOSERS


def independent(proposers: Iterable[str]) -> int:
    """How many independent proposers are among ``proposers``."""
    return len({SAME_EVIDENCE.get(proposer, proposer) for proposer in proposers})


def check_moved(matched: int, moved: int) -> Refusal | None:
    """Refuse a pose under which more objects moved than stayed: nothing is known then."""
    if moved <= matched:
        return None
    return Reason.MOVED, f"{moved} objects moved, {matched} stayed"


def check_matched(matched: int) -> Refusal | None:
    """Refuse a pose without a matched object: rooms that repeat themselves look the same."""
    return (Reason.FEW_OBJECTS, "0 objects < 1") if matched == 0 else None
