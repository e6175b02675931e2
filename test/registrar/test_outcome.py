# SPDX-License-Identifier: Apache-2.0
"""What the registrar says of a frame."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.registrar.outcome import Outcome, in_turn


def test_what_becomes_of_earlier_keyframes_is_reported_after_what_became_of_this_one() -> None:
    early, late = (
        LoopClosure(from_ns=0, to_ns=k, T_from_to=np.eye(4), covariance=np.eye(6), labels=()) for k in (1, 2)
    )
    refused = Rejected(reason=Reason.LOW_OVERLAP, from_ns=0, to_ns=1, detail="")
    outcome = Outcome(closures=(early,), keyframe_ns=7, session=3).with_late(
        Outcome(closures=(late,), rejected=(refused,))
    )
    assert outcome.closures == (early, late) and outcome.rejected == (refused,)
    assert (outcome.keyframe_ns, outcome.session) == (7, 3)


def test_of_several_in_turn_the_last_stays_with_the_closures_of_all() -> None:
    closures = [LoopClosure(from_ns=0, to_ns=k, T_from_to=np.eye(4), covariance=np.eye(6), labels=()) for k in (1, 2)]
    outcome = in_turn([Outcome(closures=(closure,), keyframe_ns=closure.to_ns) for closure in closures])
    assert outcome.closures == tuple(closures) and outcome.keyframe_ns == 2
    assert in_turn([]).closures == () and in_turn([]).keyframe_ns is None
