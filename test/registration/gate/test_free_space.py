# SPDX-License-Identifier: Apache-2.0
"""Free-space violations for which no other evidence makes up."""

from __future__ import annotations

import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.gate import free_space
from objreg_ros.registration.gate.verdict import refuse
from registration.samples import candidate

LIMITS = free_space.Limits(violations=0.15, certain=0.03)


def test_a_refusal_says_how_much_violates_free_space_and_how_much_may() -> None:
    assert free_space.check(0.15, 0.03, LIMITS) is None
    assert free_space.check(0.151, 0.0, LIMITS) == (Reason.FREE_SPACE, "violations 0.151 > 0.150")
    assert free_space.check(0.1, 0.04, LIMITS) == (Reason.FREE_SPACE, "certain violations 0.040 > 0.030")


@pytest.mark.parametrize("evidence", [{"violations": 0.16}, {"certain_violations": 0.04}], ids=str)
def test_a_likely_pose_is_refused_where_much_violates_free_space(evidence: dict[str, float]) -> None:
    refusal = refuse(candidate(**evidence))
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE
