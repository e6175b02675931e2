# SPDX-License-Identifier: Apache-2.0
"""Competing hypotheses: other poses that may be true. Of two that score the same one is wrong."""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.gate.objects import SEVERAL
from objreg_ros.registration.gate.refusal import Refusal


class Limits(NamedTuple):
    """How many matched objects confirm each other, and margins of the total score."""

    objects: int = SEVERAL  # matched objects that need no more evidence than the views
    several_margin: float = 0.1  # least of so many objects, over the best competing hypothesis
    lone_margin: float = 0.2  # least of fewer objects


def check_several(matched: int, score_margin: float, limits: Limits) -> Refusal | None:
    """Refuse a pose of several objects over which a competing hypothesis scores nearly as much."""
    if matched < limits.objects or score_margin >= limits.several_margin:
        return None
    return Reason.CHAINS_DISAGREE, (
        f"{matched} objects, another possible pose is worth {score_margin:.2f} < {limits.several_margin:.2f} less"
    )


def check_lone(
    matched: int, score_margin: float, confirmed: bool, agreeing: int, silhouette_score: float | None, limits: Limits
) -> Refusal | None:
    """Refuse a lone object's pose with a competing hypothesis, or that neither object nor grey has ``confirmed``.

    Plain rooms with one object of a kind look the same. Proposers agree on such an object, so ``agreeing`` proposers
    confirm nothing, however many; they and the silhouette score are told only.
    """
    if matched >= limits.objects or (score_margin >= limits.lone_margin and confirmed):
        return None
    return Reason.CHAINS_DISAGREE, (
        f"{matched} objects < {limits.objects}, {agreeing} chains, "
        f"likeness {silhouette_score or 0.0:.2f}, margin {score_margin:.2f}"
    )
