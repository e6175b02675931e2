# SPDX-License-Identifier: Apache-2.0
"""Free-space violations: surfaces that the pose puts where the other view saw through.

Violations lie in front of what the other view saw. Certain violations lie in front of all that it saw for some pixels
around: a pose that is right but a little off makes edges violate free space, and nothing certainly. Fewer than these
limits are weighed with the other evidence.
"""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.gate.refusal import Refusal


class Limits(NamedTuple):
    """The largest shares of the tested pixels."""

    violations: float = 0.15  # fast turns and lenses make right poses violate by up to this
    certain: float = 0.03  # a pose 16 cm off had 0.04, and everything else spoke for it


LIMITS = Limits()


def check(violations: float, certain: float, limits: Limits = LIMITS) -> Refusal | None:
    """Refuse a pose with more violations, or certain ones, than any other evidence makes up for."""
    if violations > limits.violations:
        return Reason.FREE_SPACE, f"violations {violations:.3f} > {limits.violations:.3f}"
    if certain > limits.certain:
        return Reason.FREE_SPACE, f"certain violations {certain:.3f} > {limits.certain:.3f}"
    return None
