# SPDX-License-Identifier: Apache-2.0
"""Observability: whether surfaces, views or an object hold the pose in every direction.

How firmly they do is weighed with the other evidence: `kinds` has the deviation of the position, and by how much the
view score falls where the pose is moved.
"""

from __future__ import annotations

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate.refusal import Refusal

DIRECTIONS = 6  # of a pose


def check(unobservable: int) -> Refusal | None:
    """Refuse a pose with directions that neither surfaces, views nor an object hold, however likely it is."""
    if unobservable == 0:
        return None
    return Reason.SLACK, f"{unobservable} of {DIRECTIONS} directions held by nothing"
