# SPDX-License-Identifier: Apache-2.0
"""Free-space violations for which no other evidence makes up."""

from __future__ import annotations

import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.registration.candidate import KeypointAgreement
from objreg_ros.registration.gate import free_space
from objreg_ros.registration.gate.verdict import refuse
from registration.samples import candidate

LIMITS = free_space.FreeSpaceLimits(violations=0.15, certain=0.03)


def test_a_refusal_says_how_much_violates_free_space_and_how_much_may() -> None:
    assert free_space.check(0.15, 0.03, None, LIMITS) is None
    assert free_space.check(0.151, 0.0, None, LIMITS) == (Reason.FREE_SPACE, "violations 0.151 > 0.150")
    assert free_space.check(0.1, 0.04, None, LIMITS) == (Reason.FREE_SPACE, "certain violations 0.040 > 0.030")


@pytest.mark.parametrize(
    ("cells", "rival", "held"), [(6, 4, True), (20, 0, True), (5, 0, False), (6, 5, False), (20, 19, False)]
)
def test_certain_violations_are_only_weighed_where_keypoints_all_over_the_pictures_agree(
    cells: int, rival: int, held: bool
) -> None:
    keypoints = KeypointAgreement(matches=30, cells=cells, rival_matches=0, rival_cells=rival)
    assert (free_space.check(0.1, 0.04, keypoints, LIMITS) is None) == held
    assert free_space.check(0.16, 0.04, keypoints, LIMITS) is not None


@pytest.mark.parametrize("evidence", [{"violations": 0.16}, {"certain_violations": 0.04}], ids=str)
def test_a_likely_pose_is_refused_where_much_violates_free_space(evidence: dict[str, float]) -> None:
    refusal = refuse(candidate(**evidence))
    assert refusal is not None and refusal[0] is Reason.FREE_SPACE
