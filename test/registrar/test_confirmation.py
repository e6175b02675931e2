# SPDX-License-Identifier: Apache-2.0
"""Poses that wait for others, along two passes of a corridor."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from registration.samples import box, candidate, keyframe, moved

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Reason, Rejected
from objreg_ros.keyframes.jitter import Jitter
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.registrar.closure import Decision, WaitingClosure, waiting_of
from objreg_ros.registrar.confirmation import Confirmation
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.gate.verdict import judge
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.result import AcceptedRegistration, RefusedRegistration, Registration
from registrar.test_consistency import ASIDE, TRUE, passes

PARAMS = RegistrarParams(confirm_seconds=10.0)
THINGS = (box("cup", (0.0, 0.0, 1.0)), box("book", (0.3, 0.0, 1.0), instance=2))
DOUBTFUL = {"correlation": 0.1, "tested": 2000, "perturbation_margin": 0.1}


class Pair(NamedTuple):
    """What a confirmation receives of a pair that was tried."""

    source: Keyframe
    target: Keyframe
    prior: None
    registration: Registration


def kind_of(verdict: Decision | Rejected) -> str:
    """What became of a pair."""
    if isinstance(verdict, Rejected):
        return "refused"
    return "accepted" if verdict.accepted else "waits"


def tried(at_m: float, T: Array = TRUE, by_odometry: bool = True, **evidence: object) -> Pair:
    """The pair at a place of the corridor, judged by the gate."""
    found = candidate(T, **evidence)
    verdict = judge((found,))
    source, target = (
        replace(keyframe(number, way, THINGS, T_odom_camera=moved(at_m)), travelled=way, by_odometry=by_odometry)
        for number, way in ((2, 100 + at_m), (1, at_m))
    )
    if isinstance(verdict, tuple):
        stated = RefusedRegistration(reason=verdict[0], detail=verdict[1], candidate=found)
    else:
        stated = AcceptedRegistration(T_target_source=found.T_target_source, covariance=np.eye(6), candidate=found)
    return Pair(source, target, None, stated)


def hold(confirmation: Confirmation, one: Pair, held: Decision | Rejected) -> WaitingClosure:
    assert isinstance(held, Decision) and held.refusal is not None and held.waits_as is not None
    sightings = [seen.of_landmark(7, np.eye(3)) for seen in sightings_of(one.source)]
    waiting = waiting_of(one.source, sightings, held, held.refusal, PARAMS)
    confirmation.hold(held.waits_as, waiting)
    return waiting


def test_an_accepted_pose_is_of_the_stored_keyframe_and_does_not_wait() -> None:
    one = tried(0.0)
    verdict = Confirmation(PARAMS).decide(*one)
    assert isinstance(verdict, Decision) and verdict.accepted
    assert verdict.target is one.target and verdict.candidate is one.registration.candidate


def test_a_doubtful_pose_waits_until_three_sure_ones_agree_and_keeps_its_own_stamps() -> None:
    confirmation, first = Confirmation(PARAMS), tried(0.0, **DOUBTFUL)
    hold(confirmation, first, confirmation.decide(*first))
    for at_m in (0.1, 0.2):
        confirmation.decide(*tried(at_m))
    assert confirmation.decide_waiting(first.source.stamp_ns) == ([], []) and len(confirmation) == 1
    confirmation.decide(*tried(0.4))
    (late,), refused = confirmation.decide_waiting(first.source.stamp_ns)
    assert refused == [] and len(confirmation) == 0
    assert (late.closure.from_ns, late.closure.to_ns) == (first.target.stamp_ns, first.source.stamp_ns)
    assert late.closure.evidence["agreeing"] == 3 and late.closure.evidence["agreeing_share"] > 0.99


def test_a_doubtful_pose_that_others_confirmed_before_does_not_wait() -> None:
    confirmation = Confirmation(PARAMS)
    for at_m in (0.0, 0.2, 0.3):
        confirmation.decide(*tried(at_m))
    verdict = confirmation.decide(*tried(0.4, **DOUBTFUL))
    assert (
        isinstance(verdict, Decision)
        and verdict.accepted
        and verdict.support is not None
        and verdict.support.agreeing == 3
    )


def test_a_doubtful_pose_that_slides_is_refused_in_the_end_with_the_gate_s_reason() -> None:
    confirmation, slid = Confirmation(PARAMS), tried(0.1, ASIDE, **DOUBTFUL)
    waiting = hold(confirmation, slid, confirmation.decide(*slid))
    for at_m in (0.2, 0.4, 0.6):
        confirmation.decide(*tried(at_m))
    assert confirmation.decide_waiting(slid.source.stamp_ns + 10 * 10**9) == ([], [])
    accepted, (refused,) = confirmation.decide_waiting(slid.source.stamp_ns + 10 * 10**9 + 1)
    assert accepted == [] and (refused.reason, refused.detail) == waiting.refusal
    assert np.allclose(refused.T_from_to, ASIDE) and refused.evidence == waiting.closure.evidence
    assert (refused.from_session, refused.to_session) == (slid.target.session, slid.source.session)


def test_an_accepted_pose_that_its_neighbours_contradict_is_not_published() -> None:
    confirmation = Confirmation(PARAMS)
    for at_m in (0.0, 0.2, 0.4):
        confirmation.decide(*tried(at_m))
    false = tried(0.6, ASIDE)
    assert false.registration.accepted
    hold(confirmation, false, confirmation.decide(*false))
    confirmed, (refused,) = confirmation.decide_waiting(None)
    assert confirmed == [] and refused.reason is Reason.NEIGHBOURS and "0.00 < 0.5" in refused.detail


def test_an_accepted_pose_that_jitter_excuses_is_published_and_a_moved_one_is_not() -> None:
    for T, kind in ((moved(0.12, 0.0, 0.3), "accepted"), (moved(0.4, 0.0, 0.3), "waits")):
        confirmation = Confirmation(PARAMS)
        confirmation._consistency = passes(Jitter(3.0, 0.04))
        for at_m in (10.0, 10.2, 10.4):
            confirmation.decide(*tried(at_m))
        assert kind_of(confirmation.decide(*tried(10.5, T))) == kind


def test_our_own_tracking_confirms_and_contradicts_nothing() -> None:
    confirmation = Confirmation(PARAMS)
    for at_m in (0.0, 0.2, 0.4):
        confirmation.decide(*tried(at_m, by_odometry=False))
    assert kind_of(confirmation.decide(*tried(0.5, by_odometry=False, **DOUBTFUL))) == "accepted"
    assert kind_of(confirmation.decide(*tried(0.6, ASIDE, by_odometry=False))) == "accepted"


def test_an_accepted_pose_that_was_contradicted_by_false_ones_is_published_when_others_come() -> None:
    confirmation = Confirmation(PARAMS)
    for at_m in (0.0, 0.2):
        confirmation.decide(*tried(at_m, ASIDE))
    right = tried(0.4)
    hold(confirmation, right, confirmation.decide(*right))
    for at_m in (0.5, 0.6, 0.7):
        confirmation.decide(*tried(at_m))
    (late,), _ = confirmation.decide_waiting(right.source.stamp_ns)
    assert late.closure.to_ns == right.source.stamp_ns


@pytest.mark.parametrize(
    "evidence", [{"certain_violations": 0.2}, {"converged": False}, {"correlation": -0.9, "tested": 50}]
)
def test_what_is_impossible_or_unlikely_never_waits(evidence: dict[str, object]) -> None:
    confirmation = Confirmation(PARAMS)
    for at_m in (0.0, 0.2, 0.3):
        confirmation.decide(*tried(at_m))
    poor = {"perturbation_margin": 0.0, "information": np.diag([1e2] * 6), **evidence}
    assert isinstance(confirmation.decide(*tried(0.4, **poor)), Rejected)


@pytest.mark.parametrize(("margin", "kind"), [(0.01, "refused"), (0.03, "waits")])
def test_what_nothing_holds_is_not_confirmed_by_neighbours_that_slide_alike(margin: float, kind: type) -> None:
    loose = {**DOUBTFUL, "correlation": 0.3, "perturbation_margin": margin}
    assert kind_of(Confirmation(PARAMS).decide(*tried(0.4, **loose))) == kind


def test_nothing_waits_where_no_time_is_given() -> None:
    confirmation = Confirmation(PARAMS.replaced(confirm_seconds=0.0))
    for at_m in (0.0, 0.2, 0.3):
        confirmation.decide(*tried(at_m))
    assert isinstance(confirmation.decide(*tried(0.4, **DOUBTFUL)), Rejected)
    assert kind_of(confirmation.decide(*tried(0.6, ASIDE))) == "accepted"


def test_a_refusal_states_its_reason_its_moments_and_the_pose_that_was_refused() -> None:
    one = tried(0.0, certain_violations=0.2)
    verdict = Confirmation(PARAMS).decide(*one)
    assert isinstance(verdict, Rejected) and verdict.reason is Reason.FREE_SPACE
    assert (verdict.from_ns, verdict.to_ns) == (one.target.stamp_ns, one.source.stamp_ns)
    assert np.array_equal(verdict.T_from_to, TRUE) and verdict.evidence == one.registration.evidence
    assert (verdict.from_frame_id, verdict.from_session) == (one.target.frame_id, one.target.session)
    assert (verdict.to_frame_id, verdict.to_session) == (one.source.frame_id, one.source.session)


def test_a_gate_that_refuses_without_a_reason_is_an_error() -> None:
    with pytest.raises(ValueError, match="expected a reason with each refusal, got None"):
        Confirmation(PARAMS).decide(*tried(0.0)._replace(registration=RefusedRegistration(reason=None)))


def test_what_only_odometry_speaks_against_is_contrary_and_is_taken_once() -> None:
    confirmation, one = Confirmation(PARAMS), tried(0.0)
    for reason, taken in ((Reason.ODOMETRY, 1), (Reason.FREE_SPACE, 0)):
        refused = RefusedRegistration(reason=reason, detail="", candidate=one.registration.candidate)
        confirmation.decide(*one._replace(registration=refused))
        contrary = confirmation.take_contrary()
        assert [target for target, _ in contrary] == [one.target] * taken
        assert all(found is one.registration.candidate for _, found in contrary)
        assert confirmation.take_contrary() == []


def test_an_accepted_pose_that_its_neighbours_contradict_is_contrary_and_one_that_is_published_is_not() -> None:
    confirmation = Confirmation(PARAMS)
    for at_m in (0.0, 0.1, 0.2):
        confirmation.decide(*tried(at_m))
    assert confirmation.take_contrary() == []
    wrong = tried(0.3, ASIDE)
    assert kind_of(confirmation.decide(*wrong)) == "waits"
    assert confirmation.take_contrary() == [(wrong.target, wrong.registration.candidate)]
