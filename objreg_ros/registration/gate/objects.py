# SPDX-License-Identifier: Apache-2.0
"""Objects: how many are matched, how many moved, and which proposers came to them independently."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from objreg_ros.data.closures import Reason
from objreg_ros.data.frames import UNNAMED
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.gate.refusal import Refusal

SEVERAL = 2  # matched objects; fewer locate one object, and not the direction from which the camera saw it
LEAST_UNNAMED = 3  # matched objects without a name that make up for one with a name
UNNAMED_COUNTS = 0.5  # of what an object with a name counts: any two of these may be taken for one
SAME_EVIDENCE = {"centroids": "objects", "odometry": "objects", "keypoints": "features"}
"""Proposers that are no evidence beside another one. The search for object poses starts from the centroids too. What
drifting odometry expects is refined to whatever the objects fit nearby, right or wrong. What keypoints say is weighed
by how many of them agree."""


def is_lone(matched: Sequence[ObjectPair]) -> bool:
    """Whether no second object supports the pose: what moved alone agrees with itself, whoever proposed it."""
    return counted(matched) < SEVERAL


def independent(proposers: Iterable[str]) -> int:
    """How many independent proposers are among ``proposers``."""
    return len({SAME_EVIDENCE.get(proposer, proposer) for proposer in proposers})


def counted(pairs: Sequence[ObjectPair]) -> float:
    """How many objects the ``pairs`` count for: those without a name for less than the others."""
    unnamed = sum(pair.label == UNNAMED for pair in pairs)
    return len(pairs) - (1.0 - UNNAMED_COUNTS) * unnamed


def check_moved(matched: float, moved: float) -> Refusal | None:
    """Refuse a pose under which more objects moved than stayed: nothing is known then."""
    if moved <= matched:
        return None
    return Reason.MOVED, f"{moved:g} objects moved, {matched:g} stayed"


def check_matched(matched: Sequence[ObjectPair], least_unnamed: int = LEAST_UNNAMED) -> Refusal | None:
    """Refuse a pose without a matched object: rooms that repeat themselves look the same.

    One with a name is enough, or ``least_unnamed`` without: their kind is unknown, so any may be another.
    """
    if any(pair.label != UNNAMED for pair in matched) or len(matched) >= least_unnamed:
        return None
    detail = f"0 objects < 1, {len(matched)} without a name < {least_unnamed}" if matched else "0 objects < 1"
    return Reason.FEW_OBJECTS, detail
