# SPDX-License-Identifier: Apache-2.0
"""Free-space violations: surfaces that the pose puts where the other view saw through.

Violations lie in front of what the other view saw. Certain violations lie in front of all that it saw for some pixels
around: a pose that is right but a little off makes edges violate free space, and nothing certainly.
"""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.gate.refusal import Refusal


class Limits(NamedTuple):
    """The largest shares of the tested pixels."""

    violations: float = 0.07  # of any pose
    certain_doubtful: float = 0.012  # certain violations, of a doubtful pose
    certain_few: float = 0.015  # certain violations, of a pose with few matched objects


def check(violations: float, certain: float, doubtful: bool, limits: Limits) -> Refusal | None:
    """Refuse a pose by its violations, and a ``doubtful`` one by its certain violations too.

    A pose of a lone object is doubtful: a half turn about the object shows in free space alone. So is a pose of several
    objects with another silhouette: they stand where others stood.
    """
    return check_violations(violations, limits.violations) or (
        _check_certain(certain, limits.certain_doubtful) if doubtful else None
    )


def check_violations(violations: float, most: float) -> Refusal | None:
    """Refuse a pose with more than ``most`` violations."""
    if violations <= most:
        return None
    return Reason.FREE_SPACE, f"violations {violations:.3f} > {most:.3f}"


def check_few(certain: float, few: bool, limits: Limits) -> Refusal | None:
    """Refuse a pose of ``few`` matched objects by its certain violations.

    Few objects may have moved together and fill most of the views. What stayed violates free space then.
    """
    return _check_certain(certain, limits.certain_few) if few else None


def _check_certain(certain: float, most: float) -> Refusal | None:
    if certain <= most:
        return None
    return Reason.FREE_SPACE, f"{certain:.3f} float > {most:.3f}"
