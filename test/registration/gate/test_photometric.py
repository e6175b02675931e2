# SPDX-License-Identifier: Apache-2.0
"""The correlation of grey."""

from __future__ import annotations

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.gate import photometric
from objreg_ros.registration.gate.limits import LIMITS
from objreg_ros.registration.gate.verdict import refuse
from objreg_ros.registration.propose.evidence import MANY_MATCHES
from registration.samples import candidate


def test_few_objects_need_grey_that_correlates_and_many_need_grey_that_does_not_contradict() -> None:
    for correlation, few, accepted in ((0.3, True, True), (0.2, True, False), (0.0, False, True), (-0.1, False, False)):
        refusal = photometric.check(correlation, few, 0.3)
        assert (refusal is None) is accepted and (accepted or refusal[0] is Reason.TEXTURE)
    assert photometric.check(None, True, 0.3) is None


def test_a_limit_below_that_of_a_plain_table_holds_for_many_objects_too() -> None:
    assert photometric.check(-0.1, False, -0.2) is None and photometric.check(-0.3, False, -0.2) is not None


def test_the_correlation_may_fall_by_so_much_without_the_objects() -> None:
    assert photometric.check_loss(0.5, 0.6, 0.25) is None
    assert photometric.check_loss(None, 0.6, 0.25) is None and photometric.check_loss(0.1, None, 0.25) is None
    assert photometric.check_loss(0.3, 0.6, 0.25) == (Reason.TEXTURE, "correlation 0.30 < 0.60 by more than 0.25")


def test_a_plain_table_needs_no_print_where_several_objects_stand_where_they_should() -> None:
    several = tuple(ObjectPair(k, k, "cup") for k in range(MANY_MATCHES))
    plain = {"texture": 0.5 * LIMITS.correlation}
    assert refuse(candidate(matched=several, **plain)) is None
    for evidence in ({"matched": several[:-1], **plain}, {"matched": several, "texture": -0.1}):
        refusal = refuse(candidate(**evidence))
        assert refusal is not None and refusal[0] is Reason.TEXTURE
