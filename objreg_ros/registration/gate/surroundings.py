# SPDX-License-Identifier: Apache-2.0
"""Surroundings: the views without the one or two matched objects that fill much of them.

Objects that moved together and fill the views agree with themselves, and carry their print along: a monitor that had
moved by 38 cm had a view score of 0.83. So what is around them must agree by itself. Around a lone object it must score
as a view: a bare table goes along with a monitor that has moved by 80 cm.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from objreg_ros.data.closures import Reason
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.gate.refusal import Refusal


class SurroundingsLimits(NamedTuple):
    """What is asked of the surroundings."""

    tested: int = 600  # least number of pixels of both views that land in the other one
    inliers: float = 0.35  # least share of those whose depth agrees
    correlation_loss: float = 0.25  # largest, from the whole views to the surroundings
    score: float = 0.25  # least view score around a lone object: five of five false ones had less, 45 of 321 right ones


LIMITS = SurroundingsLimits()


def check(
    around: Verification | None,
    whole: Verification,
    labels: Iterable[str],
    lone: bool,
    limits: SurroundingsLimits = LIMITS,
) -> Refusal | None:
    """Refuse a pose that its surroundings do not confirm; ``labels`` are those of the matched objects.

    ``around`` is None where the objects are small in both views, none or many. ``lone`` says that fewer than two
    objects count.
    """
    if around is None:
        return None
    refusal = (
        _check_overlap(around, limits)
        or _check_loss(around.correlation, whole.correlation, limits.correlation_loss)
        or (_check_score(around.score, limits.score) if lone else None)
    )
    return refusal and (refusal[0], f"without the {' and the '.join(labels)} {refusal[1]}")


def _check_score(score: float, least: float) -> Refusal | None:
    return None if score >= least else (Reason.LOW_OVERLAP, f"view score {score:.2f} < {least:.2f}")


def _check_overlap(around: Verification, limits: SurroundingsLimits) -> Refusal | None:
    if around.tested < limits.tested:
        return Reason.LOW_OVERLAP, f"{around.tested} pixels tested < {limits.tested}"
    if around.inliers < limits.inliers:
        return Reason.LOW_OVERLAP, f"inliers {around.inliers:.2f} < {limits.inliers:.2f}"
    return None


def _check_loss(around: float | None, whole: float | None, most: float) -> Refusal | None:
    """Refuse a pose whose grey correlates by more than ``most`` less around the objects than in the ``whole`` views."""
    if around is None or whole is None or whole - around <= most:
        return None
    return Reason.TEXTURE, f"correlation {around:.2f} < {whole:.2f} by more than {most:.2f}"
