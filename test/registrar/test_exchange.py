# SPDX-License-Identifier: Apache-2.0
"""Registrars that each keep their own store find what one for all would, and look at every pair once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from registration import rooms
from registration.samples import SECOND, candidate

from objreg_ros.data.checked import Array
from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure, Reason
from objreg_ros.data.frames import Frame
from objreg_ros.geometry import inverse, pose_error
from objreg_ros.registrar import summary
from objreg_ros.registrar.exchange import Allowance, Exchange
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.peers import known, pending, wishes
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registrar.summary import (
    Name,
    Request,
    Summary,
    name_of,
    pack_delivery,
    pack_request,
    pack_summary,
    unpack_delivery,
    unpack_request,
    unpack_summary,
)
from objreg_ros.registration import method_of
from objreg_ros.registration.candidate import ObjectPair

PARAMS = RegistrarParams()
HERE = rooms.look_at((0.2, 0.0, 1.3), (1.8, 0.0, 0.75))
BESIDE = rooms.look_at((0.35, 0.25, 1.25), (1.8, 0.0, 0.75))
AWAY = rooms.look_at((0.2, 0.0, 1.3), (2.8, -1.4, 1.0))
NOW = 100.0


class Knowing:
    """A method that proposes the true pose: odometry is in the world here. ``tried`` has the stamps of the pairs."""

    def __init__(self, **evidence: object) -> None:
        self.tried: list[tuple[int, int]] = []
        self.evidence: dict[str, object] = evidence

    def prepare(self, keyframe: object) -> None:
        """Nothing to make ready."""

    def propose(self, source: Any, target: Any, prior: object = None) -> tuple:
        self.tried.append((target.stamp_ns // SECOND, source.stamp_ns // SECOND))
        pairs = tuple(
            ObjectPair(a, b, one.label)
            for a, one in enumerate(source.objects)
            for b, other in enumerate(target.objects)
            if one.label == other.label
        )
        T = inverse(target.T_odom_camera) @ source.T_odom_camera
        return (candidate(T, matched=pairs[:2], **self.evidence),)


class Robot:
    """A registrar with its exchange, which makes a keyframe of each view."""

    def __init__(self, name: str, params: RegistrarParams = PARAMS, method: Any = None, **how: Any) -> None:
        self.name, self.method = name, method or Knowing()
        self.registrar = Registrar(params, method=self.method)
        self.exchange = Exchange(self.registrar, name, **{"run": name, **how})

    def sees(self, seconds: float, T_world_camera: Array) -> bytes:
        """The summary of what it sees."""
        summary = self.exchange.announce(self.searched(seconds, T_world_camera))
        assert summary is not None
        return summary

    def searched(self, seconds: float, T_world_camera: Array) -> Outcome:
        self.registrar.track(replace(_frame(seconds, T_world_camera), robot=self.name))
        (window,) = self.registrar.end_windows()
        return self.registrar.search(window)

    def fetches(self, summary: bytes, other: Robot) -> Outcome | None:
        """What the keyframe of another's summary comes to here; None where it is not asked for."""
        request = self.exchange.receive_summary(summary)
        if request is None:
            return None
        other.exchange.note(request, NOW)
        packed = other.exchange.answer(NOW)
        assert packed is not None
        return self.exchange.receive_delivery(packed)


def _frame(seconds: float, T_world_camera: Array) -> Frame:
    seen = rooms.keyframe(T_world_camera, seed=round(10 * seconds))
    return Frame(
        objects=tuple(item.cloud for item in seen.objects),
        support=None,
        view=seen.view,
        gravity=seen.gravity,
        gravity_confidence=1.0,
        T_odom_camera=T_world_camera,
        stamp_ns=round(1e9 * seconds),
    )


def _moments(closures: Iterable[LoopClosure]) -> list[tuple[tuple[str, str], int, int]]:
    return [(one.robots, one.from_ns // SECOND, one.to_ns // SECOND) for one in closures]


def test_a_place_of_two_robots_closes_a_loop_at_the_true_pose_that_names_both() -> None:
    a = Robot("a", method=method_of(PARAMS))
    b = Robot("b", method=method_of(PARAMS))
    a.sees(10, HERE)
    outcome = a.fetches(b.sees(30, BESIDE), b)
    assert outcome is not None and outcome.keyframe_ns is None
    (closure,) = outcome.closures
    assert _moments([closure]) == [(("a", "b"), 10, 30)]
    rotation, distance = pose_error(closure.T_from_to, inverse(HERE) @ BESIDE)
    assert rotation < 1.0 and distance < 2.0
    assert [stored.robots for stored in a.registrar._store.closures()] == [("a", "b")]


def test_what_is_fetched_is_not_stored_and_its_objects_go_by_our_landmarks() -> None:
    a, b = Robot("a"), Robot("b")
    b.sees(1, AWAY)
    a.sees(10, HERE)
    known = {landmark.landmark: landmark.sightings for landmark in a.registrar.landmarks}
    outcome = a.fetches(b.sees(30, BESIDE), b)
    assert outcome is not None
    (closure,) = outcome.closures
    assert len(closure.objects) == 2 and {match.object_id for match in closure.objects} <= set(known)
    assert {landmark.landmark: landmark.sightings for landmark in a.registrar.landmarks} == known
    assert a.registrar.counts()["keyframes"] == 1 and a.registrar.counts()["closures"] == 1


def test_sessions_of_others_have_numbers_that_none_of_ours_has() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    (closure,) = a.fetches(b.sees(30, BESIDE), b).closures  # type: ignore[union-attr]
    assert closure.from_session == 0 and closure.to_session not in (0, None)
    a.registrar.reset()
    a.searched(40, AWAY)
    assert a.registrar.landmarks and a.registrar.landmarks[0].session not in (0, closure.to_session)


def test_a_session_of_another_that_a_stored_closure_names_keeps_its_number_to_itself(tmp_path: Path) -> None:
    params = PARAMS.replaced(store=str(tmp_path / "a.db"))
    a, b = Robot("a", params), Robot("b")
    a.sees(10, HERE)
    (closure,) = a.fetches(b.sees(30, BESIDE), b).closures  # type: ignore[union-attr]
    a.registrar.close()
    again = Registrar(params)
    assert again.take_session() not in (closure.from_session, closure.to_session)
    again.close()


def test_what_was_withdrawn_of_another_robot_stays_so_after_a_restart(tmp_path: Path) -> None:
    params = PARAMS.replaced(store=str(tmp_path / "a.db"))
    a, b = Robot("a", params), Robot("b")
    a.sees(10, HERE)
    summary = b.sees(30, BESIDE)
    (closure,) = a.fetches(summary, b).closures  # type: ignore[union-attr]
    name = closure_id(closure)
    a.registrar.veto([name])
    a.registrar.close()
    again = Robot("a", params, run="a, once more")
    outcome = again.fetches(summary, b)  # its session has another number now
    assert outcome is not None and not outcome.closures
    assert [refusal.reason for refusal in outcome.rejected] == [Reason.VETOED]
    assert again.registrar.undo_veto([name]).closures
    again.registrar.close()


def test_what_is_too_large_to_be_announced_is_counted_and_its_outcome_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(summary, "SUMMARY", replace(summary.SUMMARY, most_packed=1000, most_unpacked=1000))
    a = Robot("a")
    seen = _frame(10, HERE)
    named = [replace(seen.objects[0], label=f"{k:0900d}", instance=k + 1) for k in range(480)]
    a.registrar.track(replace(seen, objects=tuple(named), robot="a"))
    (window,) = a.registrar.end_windows()
    assert a.exchange.announce(a.registrar.search(window)) is None
    assert a.exchange.counters == {"dropped: too large to announce": 1}


def test_a_keyframe_without_objects_of_ours_is_not_asked_for() -> None:
    a, b = Robot("a"), Robot("b")
    assert a.exchange.receive_summary(b.sees(30, HERE)) is None
    assert a.exchange.counters["dropped: unlike"] == 1 and a.exchange.counters["summaries received"] == 1


def test_a_summary_that_is_received_twice_asks_nothing_twice() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    summary = b.sees(30, BESIDE)
    assert a.exchange.receive_summary(summary) is not None
    assert a.exchange.receive_summary(summary) is None and a.exchange.counters["dropped: received before"] == 1


def test_ones_own_summary_and_that_of_a_robot_of_ones_name_ask_nothing() -> None:
    a, namesake = Robot("a"), Robot("a", run="another")
    a.sees(10, HERE)
    assert a.exchange.receive_summary(a.sees(20, BESIDE)) is None and not a.exchange.counters["summaries received"]
    assert a.exchange.receive_summary(namesake.sees(30, BESIDE)) is None
    assert a.exchange.counters["dropped: a robot of our name"] == 1


def test_a_later_keyframe_of_ours_is_looked_at_by_the_other() -> None:
    a, b = Robot("a"), Robot("b")
    assert a.exchange.receive_summary(b.sees(10, HERE)) is None
    outcome = b.fetches(a.sees(30, BESIDE), a)
    assert outcome is not None and _moments(outcome.closures) == [(("b", "a"), 10, 30)]


@pytest.mark.parametrize(("of_a", "of_b"), [(30, 31), (31, 30), (30, 30)])
def test_of_two_summaries_sent_before_either_is_received_that_of_the_older_is_compared(of_a: int, of_b: int) -> None:
    a, b = Robot("a"), Robot("b")
    sent_by_a, sent_by_b = a.sees(of_a, HERE), b.sees(of_b, BESIDE)
    asked = a.exchange.receive_summary(sent_by_b) is not None, b.exchange.receive_summary(sent_by_a) is not None
    assert asked == ((True, False) if of_a <= of_b else (False, True))


def test_whoever_has_a_keyframe_when_it_receives_looks_though_clocks_differ() -> None:
    a, b = Robot("a"), Robot("b")
    b.exchange.receive_summary(a.sees(5000, HERE))
    outcome = a.fetches(b.sees(30, BESIDE), b)
    assert outcome is not None and _moments(outcome.closures) == [(("a", "b"), 5000, 30)]


def test_a_keyframe_that_is_stored_but_not_announced_yet_is_left_to_the_other() -> None:
    a, b = Robot("a"), Robot("b")
    searched = a.searched(10, HERE)
    assert a.exchange.receive_summary(b.sees(30, BESIDE)) is None
    summary = a.exchange.announce(searched)
    assert summary is not None and b.exchange.receive_summary(summary) is not None


def test_every_pair_of_three_robots_is_looked_at_once() -> None:
    params = PARAMS.replaced(candidates=20, closures=20, thin_seconds=0.0)
    robots = [Robot(name, params) for name in "abc"]
    views = [HERE, BESIDE, AWAY]
    for k in range(6):
        robot = robots[k % 3]
        summary = robot.sees(10 + k, views[k // 2])
        for other in (one for one in robots if one is not robot):
            other.fetches(summary, robot)
    between = [pair for robot in robots for pair in robot.method.tried if (pair[0] - pair[1]) % 3]
    assert len(between) == len(set(between)) == 12


def test_the_most_promising_is_answered_first_and_one_answer_serves_all() -> None:
    b = Robot("b")
    b.sees(1, HERE), b.sees(2, AWAY), b.sees(3, BESIDE)
    for name in "ac":
        b.exchange.receive_summary(Robot(name).sees(1, AWAY))
    for asker, number, votes in (("a", 1, 2.0), ("a", 2, 1.5), ("a", 3, 2.5), ("c", 2, 1.5), ("c", 2, 1.5)):
        b.exchange.note(pack_request(Request(Name("b", number), votes, asker)), NOW)
    assert b.exchange.waiting == 3
    order = [unpack_delivery(packed)[0].keyframe_id for packed in iter(lambda: b.exchange.answer(NOW), None)]
    assert order == [2, 3, 1] and b.exchange.counters["keyframes sent"] == 3


def test_what_is_sent_stays_within_bytes_per_second_and_what_waits_too_long_is_dropped() -> None:
    b = Robot("b", bytes_per_second=1000.0)
    sent = len(b.sees(1, HERE)) + len(b.sees(2, AWAY))
    for number in (1, 2):
        b.exchange.note(pack_request(Request(Name("b", number), 1.0)), NOW)
    first = b.exchange.answer(NOW)
    assert first is not None and b.exchange.answer(NOW) is None
    paid = NOW + (sent + len(first) - 2000) / 1000.0
    assert b.exchange.answer(paid - 1.0) is None
    assert b.exchange.counters["bytes sent"] == sent + len(first)
    assert b.exchange.answer(NOW + wishes.PATIENCE_S + 1.0) is None
    assert b.exchange.counters["dropped: waited too long"] == 1 and b.exchange.waiting == 0


def test_an_allowance_adds_up_to_a_burst_and_debts_are_made_up_for() -> None:
    allowance = Allowance(100.0)
    assert allowance.some_left(1000.0)
    allowance.spend(450)
    assert [allowance.some_left(1000.0 + s) for s in (0.0, 2.0, 2.6, 1.0)] == [False, False, True, True]
    allowance.spend(260)
    assert not allowance.some_left(1003.0) and allowance.some_left(9000.0)
    endless = Allowance(np.inf)
    endless.spend(10**9)
    assert endless.some_left(0.0) and endless.some_left(0.0)


def test_a_request_for_what_is_not_ours_or_not_there_any_more_is_not_answered() -> None:
    b = Robot("b")
    b.sees(1, HERE)
    b.exchange.note(pack_request(Request(Name("another", 1), 1.0)), NOW)
    assert b.exchange.waiting == 0
    b.exchange.note(pack_request(Request(Name("b", 77), 1.0)), NOW)
    assert b.exchange.answer(NOW) is None and b.exchange.counters["dropped: not to be had"] == 1


def test_of_too_many_requests_the_least_promising_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wishes, "MOST_WAITING", 2)
    b = Robot("b")
    b.sees(1, HERE), b.sees(2, AWAY), b.sees(3, BESIDE)
    for number, votes in ((1, 3.0), (2, 1.0), (3, 2.0)):
        b.exchange.note(pack_request(Request(Name("b", number), votes)), NOW)
    assert b.exchange.waiting == 2 and b.exchange.counters["dropped: crowded"] == 1
    order = [unpack_delivery(packed)[0].keyframe_id for packed in iter(lambda: b.exchange.answer(NOW), None)]
    assert order == [1, 3]


def test_a_keyframe_that_was_not_asked_for_comes_to_nothing_and_another_one_is_refused() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    summary = b.sees(30, BESIDE)
    request = a.exchange.receive_summary(summary)
    assert request is not None and unpack_request(request).name == Name("b", 1)
    keyframe, _ = b.registrar.moment(1)
    keyframe = replace(keyframe, frame_id=f"b/{keyframe.frame_id}")
    with pytest.raises(ValueError, match="expected the keyframe of its summary, got one at 31000000000 ns"):
        a.exchange.receive_delivery(pack_delivery("b", replace(keyframe, stamp_ns=31 * SECOND)))
    assert a.exchange.receive_delivery(pack_delivery("c", keyframe)) is None
    assert a.exchange.counters["dropped: not asked for"] == 1


def test_what_a_closure_ties_already_is_not_asked_for() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    assert a.fetches(b.sees(30, BESIDE), b).closures  # type: ignore[union-attr]
    assert a.exchange.receive_summary(b.sees(30.5, HERE)) is None


def test_a_stored_keyframe_that_was_forgotten_meanwhile_is_not_tried() -> None:
    a, b = Robot("a", PARAMS.replaced(max_keyframes=1)), Robot("b")
    a.sees(10, HERE)
    request = a.exchange.receive_summary(b.sees(30, BESIDE))
    a.sees(50, AWAY)
    b.exchange.note(request, NOW)  # type: ignore[arg-type]
    outcome = a.exchange.receive_delivery(b.exchange.answer(NOW))  # type: ignore[arg-type]
    assert outcome is not None and (outcome.closures, outcome.rejected) == ((), ())
    assert b.exchange.announce(Outcome()) is None


def test_no_time_refuses_as_over_budget() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    b.exchange.note(a.exchange.receive_summary(b.sees(30, BESIDE)), NOW)  # type: ignore[arg-type]
    outcome = a.exchange.receive_delivery(b.exchange.answer(NOW), seconds=0.0)  # type: ignore[arg-type]
    assert outcome is not None and {refusal.reason for refusal in outcome.rejected} == {Reason.OVER_BUDGET}


def test_what_waits_for_others_is_published_late_by_our_landmarks() -> None:
    method, doubts = Knowing(), {"correlation": 0.1, "tested": 2000, "perturbation_margin": 0.1}
    params = PARAMS.replaced(thin_seconds=0.1, closures=1, candidates=1)
    a, b = Robot("a", params, method), Robot("b", params)
    sides = [rooms.look_at((0.2, 0.2 * side, 1.3), (1.8, 0.0, 0.75)) for side in (-1.0, 0.0, 1.0, 2.0)]
    for k, T in enumerate(sides):
        a.sees(10 + k, T)
    closures: list[LoopClosure] = []
    for k, T in enumerate(sides):
        method.evidence = doubts if k == 0 else {}
        outcome = a.fetches(b.sees(30 + k, T), b)
        closures += () if outcome is None else outcome.closures
        assert k or a.registrar.waiting == 1
    (late,) = [one for one in closures if one.to_ns == 30 * SECOND]
    assert late.evidence["agreeing"] >= 3 and late.robots == ("a", "b") and a.registrar.waiting == 0
    assert {match.object_id for match in late.objects} <= {one.landmark for one in a.registrar.landmarks}
    assert 30 * SECOND in [stored.to_ns for stored in a.registrar._store.closures()]


def test_after_a_restart_what_the_store_has_is_not_published_again(tmp_path: Path) -> None:
    params = PARAMS.replaced(store=str(tmp_path / "place.db"))
    a, b = Robot("a", params), Robot("b")
    a.sees(10, HERE)
    summary = b.sees(30, BESIDE)
    assert len(a.fetches(summary, b).closures) == 1  # type: ignore[union-attr]
    a.registrar.close()
    a = Robot("a", params, run="a again")
    outcome = a.fetches(summary, b)
    assert outcome is not None and outcome.closures == ()
    assert {refusal.reason for refusal in outcome.rejected} == {Reason.REDUNDANT}
    later = a.fetches(b.sees(60, HERE), b)
    assert later is not None and _moments(later.closures) == [(("a", "b"), 10, 60)]
    a.registrar.close()


def test_frames_without_a_robot_go_by_the_name_of_the_exchange() -> None:
    a, b = Robot("a"), Robot("b")
    a.registrar.track(_frame(10, HERE))
    (window,) = a.registrar.end_windows()
    a.exchange.announce(a.registrar.search(window))
    (closure,) = a.fetches(b.sees(30, BESIDE), b).closures  # type: ignore[union-attr]
    assert closure.robots == ("a", "b")


def _as(summary: bytes, run: str, number: int, robot: str = "", frame_id: str = "") -> bytes:
    """A summary that was forged out of another one."""
    true = unpack_summary(summary)
    robot = robot or true.robot
    sightings = tuple(replace(one, robot=robot) for one in true.sightings)
    forged = {"name": Name(run, number), "sightings": sightings, "frame_id": frame_id or f"{robot}/camera"}
    return pack_summary(replace(true, **forged))


@pytest.mark.parametrize("comes_first", [True, False])
def test_a_forged_summary_with_the_run_of_another_and_the_largest_number_silences_nobody(comes_first: bool) -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    if not comes_first:
        a.exchange.receive_summary(b.sees(20, AWAY))
    true = b.sees(30, BESIDE)
    a.exchange.receive_summary(_as(true, "b", 2**63 - 1))
    assert a.exchange.counters["dropped: a far jump"] == (not comes_first)
    outcome = a.fetches(true, b)
    assert outcome is not None and _moments(outcome.closures) == [(("a", "b"), 10, 30)]


def test_a_summary_under_the_name_of_the_true_one_keeps_that_out_of_nothing() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    true = b.sees(30, BESIDE)
    summary = unpack_summary(true)
    moved = tuple(replace(one, stamp_ns=one.stamp_ns + 5) for one in summary.sightings)
    a.exchange.receive_summary(pack_summary(replace(summary, sightings=moved)))
    outcome = a.fetches(true, b)
    assert outcome is not None and outcome.closures


@pytest.mark.parametrize("forged_first", [True, False])
def test_a_summary_with_the_moment_of_the_true_one_and_other_objects_does_not_take_its_place(
    forged_first: bool,
) -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    true = b.sees(30, BESIDE)
    summary = unpack_summary(true)
    moved = tuple(replace(one, position=one.position + 0.5) for one in summary.sightings)
    forged = pack_summary(replace(summary, sightings=moved))
    requests = [a.exchange.receive_summary(packed) for packed in ((forged, true) if forged_first else (true, forged))]
    b.exchange.note(next(filter(None, requests)), NOW)
    answer = b.exchange.answer(NOW)
    assert answer is not None
    outcome = a.exchange.receive_delivery(answer)
    assert outcome is not None and outcome.closures


def test_a_forged_keyframe_does_not_use_up_the_request_for_the_true_one() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    request = a.exchange.receive_summary(b.sees(30, BESIDE))
    b.exchange.note(request, NOW)  # type: ignore[arg-type]
    true = b.exchange.answer(NOW)
    assert true is not None
    keyframe = replace(unpack_delivery(true)[1], keyframe_id=1)
    elsewhere = replace(keyframe, T_odom_camera=AWAY)
    for forged in (replace(keyframe, stamp_ns=7), replace(keyframe, frame_id="e/camera"), elsewhere):
        with pytest.raises(ValueError, match="of its summary"):
            a.exchange.receive_delivery(pack_delivery("b", forged))
    outcome = a.exchange.receive_delivery(true)
    assert outcome is not None and outcome.closures
    assert a.exchange.receive_delivery(true) is None and not a.exchange.awaits(true)


def test_summaries_of_one_push_no_request_for_those_of_others_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pending, "MOST_ASKED", 20)
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    true = b.sees(30, BESIDE)
    first = a.exchange.receive_summary(true)
    assert first is not None
    forged = [_as(true, "e", number, "e") for number in range(1, 60)]
    assert sum(a.exchange.receive_summary(one) is not None for one in forged) == 19
    later = a.exchange.receive_summary(b.sees(31, HERE))
    assert later is not None and a.exchange.counters["dropped: too many asked for"] == 40
    for request in (first, later):
        b.exchange.note(request, NOW)
    packed = list(iter(lambda: b.exchange.answer(NOW), None))
    assert len(packed) == 2 and all(a.exchange.receive_delivery(one) is not None for one in packed)


def test_a_request_that_is_never_answered_keeps_its_place_for_a_while_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pending, "MOST_ASKED", 1)
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    first, second, third = b.sees(30, BESIDE), b.sees(31, HERE), b.sees(32, BESIDE)
    assert a.exchange.receive_summary(first, NOW) is not None and a.exchange.receive_summary(second, NOW) is None
    assert a.exchange.receive_summary(third, NOW + pending.ASKED_S + 1.0) is not None
    assert a.exchange.counters["dropped: not answered"] == 1


def test_a_flood_of_requests_starves_no_other_asker() -> None:
    b = Robot("b")
    for k in range(6):
        b.sees(1 + k, (HERE, BESIDE, AWAY)[k % 3])
    for name in "ae":
        b.exchange.receive_summary(Robot(name).sees(50, AWAY))
    for number in range(1, 6):
        for asker in ("e", "", "nobody that is known"):
            b.exchange.note(pack_request(Request(Name("b", number), 1e9, asker)), NOW)
    b.exchange.note(pack_request(Request(Name("b", 6), 1.0, "a")), NOW)
    order = [unpack_delivery(packed)[0].keyframe_id for packed in iter(lambda: b.exchange.answer(NOW), None)]
    assert sorted(order) == [1, 2, 3, 4, 5, 6] and order.index(6) < 3


def test_the_same_asker_gets_the_same_keyframe_again_after_a_while_only() -> None:
    a, b = Robot("a"), Robot("b")
    b.sees(1, HERE)
    b.exchange.receive_summary(a.sees(50, AWAY))
    request = pack_request(Request(Name("b", 1), 1.0, "a"))
    answered = []
    for now in (NOW, NOW + 1.0, NOW + wishes.AGAIN_S):
        b.exchange.note(request, now)
        answered.append(b.exchange.answer(now) is not None)
    assert answered == [True, False, True] and b.exchange.counters["dropped: answered before"] == 1


def test_requests_of_a_version_that_names_no_asker_are_answered() -> None:
    assert unpack_request(pack_request(Request(Name("b", 1), 1.0))).asker == ""


def test_a_frame_has_the_prefix_of_its_robot_and_a_run_one_robot() -> None:
    a, b = Robot("a"), Robot("b")
    a.sees(10, HERE)
    true = b.sees(30, BESIDE)
    assert unpack_summary(true).frame_id.startswith("b/")
    for robot, frame_id in (("e", "b/camera"), ("e", "camera"), ("e", "a/camera")):
        assert a.exchange.receive_summary(_as(true, "e", 1, robot, frame_id)) is None
    assert a.exchange.counters["dropped: a frame of another robot"] == 3
    assert a.exchange.receive_summary(true) is not None
    assert a.exchange.receive_summary(_as(true, "b", 2, "e")) is None
    assert a.exchange.counters["dropped: a run of another robot"] == 1


def test_names_of_registrars_that_there_are_not_take_no_place_of_one_that_gave_a_keyframe() -> None:
    a, b, c = Robot("a"), Robot("b"), Robot("c")
    a.sees(10, HERE)
    assert a.fetches(b.sees(30, BESIDE), b) is not None
    true = c.sees(40, BESIDE)
    forged = [_as(true, f"e{k}", 1, f"e{k}") for k in range(200)]
    for one in forged:
        a.exchange.receive_summary(one, 1.0)
    assert a.exchange.counters["dropped: too many registrars"] == 200 - (known.MOST_RUNS - 1)
    assert a.exchange.receive_summary(b.sees(33, AWAY), 2.0) is not None
    assert a.exchange.receive_summary(true, 2.0) is None
    assert a.exchange.receive_summary(true, 2.0 + known.TRIAL_S) is not None


def test_a_session_of_one_keeps_its_number_though_another_names_thousands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("objreg_ros.registrar.exchange.MOST_SESSIONS", 4)
    a = Robot("a")
    number = a.exchange._session_here("b", 0)
    for session in range(9):
        a.exchange._session_here("e", session)
    assert a.exchange._session_here("b", 0) == number and len(a.exchange._sessions) == 4


def test_the_name_is_read_off_the_head_of_a_message_and_anything_else_has_none() -> None:
    b = Robot("b", run='quoted " run')
    summary = b.sees(1, HERE)
    assert name_of(summary) == Name('quoted " run', 1) and isinstance(unpack_summary(summary), Summary)
    for packed in (b"", b"short", summary[:14] + b"\0" * 90, bytes(500)):
        with pytest.raises(ValueError, match="expected a name"):
            name_of(packed)
