# SPDX-License-Identifier: Apache-2.0
"""Surroundings: the views without the one or two matched objects that fill much of them.

Objects that moved together and fill the views agree with themselves, and carry their print along. So what is around
them must pass by itself what whole views pass.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.gate import free_space, overlap, photometric
from objreg_ros.registration.gate.objects import Objects
from objreg_ros.registration.gate.refusal import Refusal


class Limits(NamedTuple):
    """What is asked of the surroundings; the first three are those of whole views."""

    overlap: overlap.Limits = overlap.Limits()
    violations: float = free_space.Limits().violations  # largest share of the tested pixels in seen free space
    correlation: float = photometric.CORRELATED  # least correlation of grey
    correlation_loss: float = 0.25  # largest, from the whole views to the surroundings
    share: float = 0.15  # least, of the tested pixels of the whole views, around a lone object


def check(
    around: Verification | None, whole: Verification, labels: Iterable[str], objects: Objects, limits: Limits
) -> Refusal | None:
    """Refuse a pose that its surroundings do not confirm; ``labels`` are those of the matched objects.

    ``around`` is None where the objects are small in both views, none or many. The view score is not asked: a small
    area scores little.
    """
    if around is None:
        return None
    refusal = (
        _check_share(around.tested, whole.tested, objects.lone, limits.share)
        or overlap.check(around.tested, around.inliers, limits.overlap)
        or free_space.check_violations(around.violations, limits.violations)
        or photometric.check(around.texture, objects.few, limits.correlation)
        or photometric.check_loss(around.texture, whole.texture, limits.correlation_loss)
    )
    return refusal and (refusal[0], f"without the {' and the '.join(labels)} {refusal[1]}")


def _check_share(around: int, whole: int, lone: bool, least: float) -> Refusal | None:
    """Refuse a ``lone`` object's pose with less than a share ``least`` of the ``whole`` pixels around the object."""
    if not lone or around >= least * whole:
        return None
    return Reason.LOW_OVERLAP, f"{around} pixels < {least:.2f} of {whole}"
