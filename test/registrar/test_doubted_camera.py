# SPDX-License-Identifier: Apache-2.0
"""What becomes of the constraints of a camera that is not believed yet, and of one that is in doubt."""

from __future__ import annotations

from dataclasses import replace

from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.data.frames import Frame
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.registrar import Registrar
from registrar.test_registrar import AWAY, BESIDE, HERE, PARAMS, _frame

WHY = "by its motion the camera has 1.30 times the focal length"


def _closures(*outcomes: Outcome) -> list[LoopClosure]:
    return [closure for outcome in outcomes for closure in outcome.closures]


def _refusals(*outcomes: Outcome) -> list[Rejected]:
    return [one for outcome in outcomes for one in outcome.rejected if one.reason is Reason.CAMERA]


def _unproven(registrar: Registrar) -> list[Outcome]:
    """A place that is seen again by a camera of which too little was seen; the revisit has been searched by then."""
    frames = _frame(0, HERE, True), _frame(1, AWAY, True), _frame(30, BESIDE, True), _frame(31, AWAY, True)
    return [registrar.process(replace(frame, proven=False)) for frame in frames]


def _doubted(frame: Frame) -> Frame:
    return replace(frame, doubt=WHY, proven=False)


def test_a_keyframe_of_a_camera_in_doubt_is_refused_and_not_stored() -> None:
    registrar = Registrar(PARAMS)
    outcomes = [registrar.process(_doubted(frame)) for frame in (_frame(0, HERE, True), _frame(1, AWAY, True))]
    refused = _refusals(*outcomes, registrar.finish(WHY))
    assert [one.detail for one in refused] == [WHY, WHY]
    assert registrar.counts()["keyframes"] == 0 and registrar.counts()["closures"] == 0


def test_a_constraint_of_a_camera_that_is_not_believed_waits_through_a_save() -> None:
    registrar = Registrar(PARAMS)
    assert _closures(*_unproven(registrar), registrar.settle()) == []
    assert registrar.counts()["closures"] == 0


def test_what_waits_is_published_with_the_keyframe_that_proves_its_camera() -> None:
    registrar = Registrar(PARAMS)
    before = _closures(*_unproven(registrar))
    frames = _frame(32, HERE, True), _frame(33, AWAY, True)
    closures = _closures(*(registrar.process(frame) for frame in frames))
    assert before == [] and (0, 30 * 10**9) in [(closure.from_ns, closure.to_ns) for closure in closures]


def test_what_waits_is_published_at_the_end_and_when_the_camera_is_silent() -> None:
    for end in (Registrar.finish, Registrar.release):
        registrar = Registrar(PARAMS)
        assert _closures(*_unproven(registrar)) == []
        closures = _closures(end(registrar))
        assert (0, 30 * 10**9) in [(closure.from_ns, closure.to_ns) for closure in closures]
        assert registrar.counts()["closures"] == len(closures)


def test_what_waits_is_refused_where_its_camera_is_in_doubt_in_the_end() -> None:
    for end in (Registrar.finish, Registrar.release):
        registrar = Registrar(PARAMS)
        _unproven(registrar)
        outcome = end(registrar, WHY)
        assert _closures(outcome, registrar.settle()) == [] and registrar.counts()["closures"] == 0
        assert (30 * 10**9, WHY) in [(one.to_ns, one.detail) for one in _refusals(outcome)]


def test_what_waits_is_refused_with_the_first_keyframe_in_doubt() -> None:
    registrar = Registrar(PARAMS)
    _unproven(registrar)
    frames = _doubted(_frame(32, HERE, True)), _doubted(_frame(33, AWAY, True))
    outcomes = [registrar.process(frame) for frame in frames]
    assert (30 * 10**9, WHY) in [(one.to_ns, one.detail) for one in _refusals(*outcomes)]
    assert _closures(*outcomes, registrar.settle()) == []


def test_what_waits_is_refused_when_the_clock_begins_anew() -> None:
    registrar = Registrar(PARAMS)
    _unproven(registrar)
    frames = _frame(2, HERE, True), _frame(3, AWAY, True)
    outcomes = [*(registrar.process(frame) for frame in frames), registrar.finish()]
    assert 30 * 10**9 in [one.to_ns for one in _refusals(*outcomes)]
    assert 30 * 10**9 not in [closure.to_ns for closure in _closures(*outcomes)]
