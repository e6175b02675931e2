# SPDX-License-Identifier: Apache-2.0
"""Free-space violations: surfaces that the pose puts where the other view saw through.

Violations lie in front of what the other view saw. Certain violations lie in front of all that it saw for some pixels
around: a pose that is right but a little off makes edges violate free space, and nothing certainly. Fewer than these
limits are weighed with the other evidence. Depth of screens and glass has holes and ghosts, which violate free space
certainly: where keypoints all over the pictures agree with the pose, certain violations are only weighed.
"""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data.closures import Reason
from objreg_ros.registration.candidate import KeypointAgreement
from objreg_ros.registration.gate.refusal import Refusal


class FreeSpaceLimits(NamedTuple):
    """The largest shares of the tested pixels, and the keypoints with which certain violations are only weighed."""

    violations: float = 0.15  # fast turns and lenses make right poses violate by up to this
    certain: float = 0.03  # a pose 16 cm off had 0.04, and everything else spoke for it
    cells: int = 6  # in which keypoints agree; false poses with more certain violations had five at most
    lead: int = 2  # cells more than any other pose


LIMITS = FreeSpaceLimits()


def check(
    violations: float, certain: float, keypoints: KeypointAgreement | None = None, limits: FreeSpaceLimits = LIMITS
) -> Refusal | None:
    """Refuse a pose with more violations, or certain ones, than any other evidence makes up for."""
    if violations > limits.violations:
        return Reason.FREE_SPACE, f"violations {violations:.3f} > {limits.violations:.3f}"
    if certain > limits.certain and not _is_held(keypoints, limits):
        return Reason.FREE_SPACE, f"certain violations {certain:.3f} > {limits.certain:.3f}"
    return None


def _is_held(keypoints: KeypointAgreement | None, limits: FreeSpaceLimits) -> bool:
    """Whether keypoints all over the pictures agree with a pose, and with no other one nearly as many."""
    if keypoints is None:
        return False
    return keypoints.cells >= limits.cells and keypoints.cells - keypoints.rival_cells >= limits.lead
