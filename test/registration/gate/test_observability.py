# SPDX-License-Identifier: Apache-2.0
"""Directions of a pose that nothing holds."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate import observability
from objreg_ros.registration.gate.verdict import refuse
from registration.samples import candidate


def test_a_refusal_says_how_many_directions_are_held_by_nothing() -> None:
    assert observability.check(0) is None
    assert observability.check(2) == (Reason.SLACK, "2 of 6 directions held by nothing")


def test_a_likely_pose_that_slides_freely_is_refused() -> None:
    refusal = refuse(candidate(degenerate=np.eye(6)[:1]))
    assert refusal is not None and refusal[0] is Reason.SLACK
