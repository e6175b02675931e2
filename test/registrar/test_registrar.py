# SPDX-License-Identifier: Apache-2.0
"""The whole registrar: frames of a known room in, closures and refusals out."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from registration import rooms
from registration.samples import SECOND, candidate, keyframe

from objreg_ros.data.checked import Array
from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.data.frames import Frame
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.keyframes.frame_window import Arrival, Clock
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import StoreError
from objreg_ros.registrar import registrar as module
from objreg_ros.registrar.closure import links_of
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.engine import Engine

PARAMS = RegistrarParams()
HERE = rooms.look_at((0.2, 0.0, 1.3), (1.8, 0.0, 0.75))
BESIDE = rooms.look_at((0.35, 0.25, 1.25), (1.8, 0.0, 0.75))
AWAY = rooms.look_at((0.2, 0.0, 1.3), (2.8, -1.4, 1.0))


def _frame(seconds: float, T_world_camera: Array, odometry: bool = False) -> Frame:
    seen = rooms.keyframe(T_world_camera, seed=round(10 * seconds))
    return Frame(
        objects=tuple(item.cloud for item in seen.objects),
        support=None,
        view=seen.view,
        gravity=seen.gravity,
        gravity_confidence=1.0,
        T_odom_camera=T_world_camera if odometry else None,
        stamp_ns=round(1e9 * seconds),
    )


def _run(registrar: Registrar, *frames: Frame) -> tuple[list[LoopClosure], list[Rejected]]:
    outcomes = [registrar.process(frame) for frame in frames] + [registrar.finish()]
    return [c for o in outcomes for c in o.closures], [r for o in outcomes for r in o.rejected]


@pytest.fixture(scope="module")
def revisit() -> tuple[list[LoopClosure], list[Rejected], Registrar]:
    """A place, a place beside it, and the first place again half a minute later."""
    registrar = Registrar(PARAMS)
    closures, rejected = _run(registrar, _frame(0, HERE, True), _frame(1, AWAY, True), _frame(30, BESIDE, True))
    return closures, rejected, registrar


def test_a_place_that_is_seen_again_closes_a_loop_at_the_true_pose(
    revisit: tuple[list[LoopClosure], list[Rejected], Registrar],
) -> None:
    closure = next(c for c in revisit[0] if c.from_ns == 0)
    assert closure.to_ns == 30_000_000_000
    rotation, distance = pose_error(closure.T_from_to, inverse(HERE) @ BESIDE)
    assert rotation < 1.0 and distance < 2.0
    assert closure.labels and closure.evidence["score"] > 0


def test_its_objects_are_matched_under_ids_that_were_known_before(
    revisit: tuple[list[LoopClosure], list[Rejected], Registrar],
) -> None:
    closure = next(c for c in revisit[0] if c.from_ns == 0)
    known = {landmark.landmark: landmark for landmark in revisit[2].landmarks}
    assert closure.objects and all(match.object_id in known for match in closure.objects)
    assert all(known[match.object_id].sightings >= 2 for match in closure.objects)


def test_the_first_keyframe_has_no_candidate(revisit: tuple[list[LoopClosure], list[Rejected], Registrar]) -> None:
    assert revisit[1][0].reason is Reason.NO_CANDIDATE and revisit[1][0].to_ns == 0


def test_a_refusal_gives_the_pose_that_was_turned_down() -> None:
    strict = PARAMS.replaced(max_translation=0.01)
    _, rejected = _run(Registrar(strict), _frame(0, HERE), _frame(30, BESIDE))
    (tried,) = [refusal for refusal in rejected if refusal.reason is Reason.IMPLAUSIBLE_MOTION]
    closures, _ = _run(Registrar(PARAMS), _frame(0, HERE), _frame(30, BESIDE))
    assert tried.T_from_to is not None and np.allclose(tried.T_from_to, closures[0].T_from_to)
    assert rejected[0].reason is Reason.NO_CANDIDATE and rejected[0].T_from_to is None


def test_an_object_that_is_met_again_is_observed_under_the_id_that_it_had() -> None:
    registrar = Registrar(PARAMS)
    outcomes = [registrar.process(frame) for frame in (_frame(0, HERE), _frame(30, BESIDE))] + [registrar.finish()]
    first, second = ({seen.object_id: seen.label for seen in o.observations} for o in outcomes if o.observations)
    (closure,) = outcomes[-1].closures
    assert closure.objects and min(first) >= 1
    for match in closure.objects:
        assert first[match.object_id] == second[match.object_id] == match.label


def test_the_same_frames_give_the_same_closures() -> None:
    frames = (_frame(0, HERE), _frame(30, BESIDE))
    first, second = (_run(Registrar(PARAMS), *frames)[0] for _ in range(2))
    assert len(first) == len(second) == 1
    assert np.array_equal(first[0].T_from_to, second[0].T_from_to)
    assert np.array_equal(first[0].covariance, second[0].covariance)


def test_a_store_brings_an_earlier_session_back(tmp_path: Path) -> None:
    params = PARAMS.replaced(store=str(tmp_path / "place.db"))
    earlier = Registrar(params)
    _run(earlier, _frame(0, HERE))
    earlier.close()
    later = Registrar(params)
    closures, _ = _run(later, _frame(100, BESIDE))
    assert [c.from_ns for c in closures] == [0]
    assert later.counts()["sessions"] == 2 and later.counts()["closures"] == 1


def test_a_later_session_says_where_it_is_in_the_map_of_the_earlier_one(tmp_path: Path) -> None:
    params = PARAMS.replaced(store=str(tmp_path / "place.db"))
    earlier = Registrar(params)
    _run(earlier, *(_frame(10 + 3 * k, T, True) for k, T in enumerate((HERE, BESIDE))))
    earlier.close()
    later, T_odom_map = (
        Registrar(params),
        pose(rotation_from_vector(np.array([0.0, 0.0, 0.8])), np.array([1.0, 2.0, 0])),
    )
    assert later.relocalised is None and later.whereabouts == "no closure to an earlier session yet"
    seen = (_frame(100 + 3 * k, T, True) for k, T in enumerate((BESIDE, HERE)))
    _run(later, *(replace(f, T_odom_camera=T_odom_map @ f.T_odom_camera) for f in seen))
    found = later.relocalised
    assert found is not None and found.session == 0 and found.stamp_ns == 103_000_000_000, later.whereabouts
    rotation, distance = pose_error(found.T_map_camera, HERE)
    assert rotation < 1.0 and distance < 2.0
    later.reset()
    assert later.relocalised is None


def test_a_search_without_time_refuses_as_over_budget_and_remembers_the_keyframe() -> None:
    registrar = Registrar(PARAMS)
    _run(registrar, _frame(0, HERE))
    assert registrar.track(_frame(30, BESIDE)) is None
    window = registrar.track(_frame(60, AWAY))
    outcome = registrar.search(window, seconds=0.0)
    assert [r.reason for r in outcome.rejected] == [Reason.OVER_BUDGET] and outcome.closures == ()
    assert registrar.counts()["keyframes"] == 2


def test_a_search_that_is_hurried_tries_no_further_place_and_remembers_the_keyframe() -> None:
    frames = [_frame(3.0 * k, T, True) for k, T in enumerate((HERE, AWAY, BESIDE, HERE))]
    last = _frame(60.0, BESIDE, True)
    for most in (0, 1):
        registrar = Registrar(PARAMS.replaced(threads=1, closures=4))
        _run(registrar, *frames)
        registrar.track(last)
        (window,) = registrar.end_windows()
        asked: list[None] = []
        outcome = registrar.search(window, hurried=lambda: asked.append(None) or len(asked) > most)  # noqa: B023
        tried = [r for r in outcome.rejected if r.reason not in (Reason.OVER_BUDGET, Reason.REDUNDANT)]
        assert len(outcome.closures) + len(tried) == most
        assert any(r.reason is Reason.OVER_BUDGET and "cut short" in r.detail for r in outcome.rejected)
        assert outcome.keyframe_ns == last.stamp_ns and registrar.counts()["keyframes"] == 5


def test_the_oldest_keyframe_goes_when_there_are_too_many() -> None:
    registrar = Registrar(PARAMS.replaced(max_keyframes=2))
    _run(registrar, *(_frame(10 * i, pose, True) for i, pose in enumerate((HERE, AWAY, BESIDE))))
    assert (registrar.counts()["keyframes"], registrar.counts()["forgotten"]) == (2, 1)
    closures, _ = _run(registrar, _frame(60, HERE, True))
    assert all(c.from_ns > 0 for c in closures)


def test_reset_forgets_and_starts_again() -> None:
    registrar = Registrar(PARAMS)
    _run(registrar, _frame(0, HERE))
    registrar.reset()
    assert registrar.landmarks == () and registrar.counts()["keyframes"] == 0
    closures, _ = _run(registrar, _frame(30, BESIDE))
    assert closures == []


def test_save_writes_a_copy_that_another_registrar_opens(tmp_path: Path) -> None:
    registrar = Registrar(PARAMS)
    _run(registrar, _frame(0, HERE))
    path = registrar.save(str(tmp_path / "copy.db"))
    assert Registrar(PARAMS.replaced(store=path)).counts()["keyframes"] == 1


def test_the_number_of_threads_changes_no_closure() -> None:
    frames = [_frame(3.0 * k, T, True) for k, T in enumerate((HERE, AWAY, BESIDE, HERE, BESIDE, AWAY))]
    alone, together = (_run(Registrar(RegistrarParams(threads=n)), *frames) for n in (1, 3))
    assert [(r.reason, r.from_ns, r.to_ns) for r in alone[1]] == [(r.reason, r.from_ns, r.to_ns) for r in together[1]]
    assert len(alone[0]) == len(together[0]) > 0
    for a, b in zip(alone[0], together[0], strict=True):
        assert (a.from_ns, a.to_ns) == (b.from_ns, b.to_ns) and np.array_equal(a.T_from_to, b.T_from_to)


def test_no_try_is_added_that_would_not_be_wanted_if_all_were_accepted() -> None:
    registrar = Registrar(RegistrarParams(closures=2, threads=2, thin_seconds=0.1))
    _run(registrar, *(_frame(3.0 * k, T, True) for k, T in enumerate((HERE, AWAY, BESIDE, AWAY, HERE, AWAY))))
    tried, propose = [], registrar._method.propose
    registrar._method.propose = lambda *pair: tried.append(pair) or propose(*pair)  # type: ignore[method-assign]
    closures, _ = _run(registrar, _frame(30.0, HERE, True))
    assert len(closures) == len(tried) == 2


def test_a_closure_says_how_far_an_object_has_moved() -> None:
    changed = tuple(
        ("bottle", (1.5, 0.6, 0.72), (1.58, 0.68, 1.0)) if box[0] == "bottle" else box for box in rooms.ROOM
    )
    later = rooms.keyframe(BESIDE, changed)
    moved = replace(_frame(30, BESIDE), view=later.view, objects=tuple(item.cloud for item in later.objects))
    closures, _ = _run(Registrar(PARAMS), _frame(0, HERE), moved)
    assert closures and closures[0].moved == {"bottle": pytest.approx(0.41, abs=0.05)}
    assert closures[0].evidence["yaw_known"] in (0.0, 1.0)


def test_a_link_turns_what_is_here_into_the_frame_of_the_session_there() -> None:
    yaws = (0.3, 0.5, 1.1)  # of the camera there, of the closure, of the camera here
    there_camera, T, here_camera = (pose(rotation_from_vector(np.array([0.0, yaw, 0.0])), np.ones(3)) for yaw in yaws)
    there = keyframe(1, T_odom_camera=there_camera)
    (known,) = sightings_of(there)
    accepted: Any = SimpleNamespace(target=there, candidate=candidate(T, matched=(ObjectPair(0, 0, "cup"),)))
    here = keyframe(2, 30.0, T_odom_camera=here_camera)
    (link,) = links_of(here, accepted, [known.of_landmark(7, np.eye(3))])
    assert (link.index, link.of.landmark) == (0, 7)
    np.testing.assert_allclose(
        link.R_there_here, rotation_from_vector(np.array([0.0, 0.3 + 0.5 - 1.1, 0.0])), atol=1e-9
    )


def test_landmarks_of_another_session_are_known_but_not_here(tmp_path: Path) -> None:
    for expected in (False, True):
        registrar = Registrar(RegistrarParams(store=str(tmp_path / "place.db")))
        assert bool(registrar.landmarks) is expected and registrar.landmarks_here == ()
        _run(registrar, _frame(0, HERE, True))
        assert registrar.landmarks_here
        registrar.close()


def test_a_stored_keyframe_that_is_damaged_is_refused_and_the_others_are_tried(tmp_path: Path) -> None:
    registrar = Registrar(RegistrarParams(store=str(tmp_path / "place.db")))
    _run(registrar, *(_frame(3.0 * k, T, True) for k, T in enumerate((HERE, AWAY, BESIDE, AWAY))))
    registrar.close()
    with sqlite3.connect(tmp_path / "place.db") as connection:
        connection.execute("UPDATE scene SET context = x'00ff00' WHERE id = 1")
    connection.close()
    again = Registrar(RegistrarParams(store=str(tmp_path / "place.db")))
    closures, rejected = _run(again, _frame(100, HERE, True))
    assert [r.from_ns for r in rejected if r.reason is Reason.UNREADABLE] == [0]
    assert 6_000_000_000 in [closure.from_ns for closure in closures]
    again.close()


def test_a_keyframe_that_cannot_be_stored_closes_nothing_and_is_in_no_later_ones_way() -> None:
    registrar = Registrar(PARAMS)
    _run(registrar, _frame(0, HERE, True))
    add = registrar._store.write_keyframe
    registrar._store.write_keyframe = refuse  # type: ignore[method-assign]
    with pytest.raises(StoreError, match="disk"):
        _run(registrar, _frame(30, BESIDE, True))
    registrar._store.write_keyframe = add  # type: ignore[method-assign]
    closures, _ = _run(registrar, _frame(30.5, HERE, True))
    assert [closure.from_ns for closure in closures] == [0]


def refuse(*_: object) -> None:
    raise StoreError("the disk is full")


def test_a_keyframe_of_before_a_reset_is_not_stored_after_it() -> None:
    registrar = Registrar(PARAMS)
    registrar.track(_frame(0, HERE, True))
    (window,) = registrar.end_windows()
    registrar.reset()
    assert registrar.search(window).keyframe_ns is None
    _run(registrar, _frame(10, HERE, True))
    assert registrar.counts()["keyframes"] == 1


def test_a_place_of_an_earlier_run_of_the_clock_that_reached_this_one_closes_nothing() -> None:
    frames = [_frame(10.0, HERE), _frame(20.0, AWAY)]
    begun_anew = [_frame(12.0, AWAY), _frame(40.0, BESIDE)]  # in this run the camera was elsewhere at 10 s
    closures, rejected = _run(Registrar(PARAMS), *frames, *begun_anew)
    (refusal,) = [r for r in rejected if r.reason is Reason.CLOCK]
    assert refusal.detail == "the clock began anew at 12.000 s; sessions up to 1 had seen that time before"
    assert {closure.from_ns for closure in closures if closure.to_ns in (12 * SECOND, 40 * SECOND)} <= {12 * SECOND}


def test_a_closure_of_an_earlier_run_of_the_clock_makes_none_of_this_one_redundant() -> None:
    runs = [_frame(t, T) for _ in range(2) for t, T in ((10.0, HERE), (40.0, BESIDE))]
    closures, _ = _run(Registrar(PARAMS), *runs)
    assert [(closure.from_ns, closure.to_ns) for closure in closures] == 2 * [(10 * SECOND, 40 * SECOND)]


def test_however_often_a_clock_began_anew_its_last_run_closes_loops() -> None:
    runs = [_frame(t, T) for _ in range(10) for t, T in ((10.0, HERE), (20.0, BESIDE))]
    closures, _ = _run(Registrar(PARAMS), *runs, _frame(10.0, HERE), _frame(40.0, BESIDE))
    assert (10 * SECOND, 40 * SECOND) in {(closure.from_ns, closure.to_ns) for closure in closures}


def test_a_place_of_before_a_restart_closes_a_loop_where_the_clock_went_on(tmp_path: Path) -> None:
    params = replace(PARAMS, store=str(tmp_path / "place.db"))
    first = Registrar(params)
    _run(first, _frame(10.0, HERE))
    first.close()
    closures, rejected = _run(Registrar(params), _frame(30.0, BESIDE))
    assert [closure.from_ns for closure in closures] == [10 * SECOND]
    assert Reason.CLOCK not in {r.reason for r in rejected}


def test_a_surplus_that_cannot_be_forgotten_now_takes_nothing_away(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise StoreError("the disk is full")

    registrar = Registrar(replace(PARAMS, max_keyframes=1))
    monkeypatch.setattr(registrar._store, "remove", refuse)
    closures, _ = _run(registrar, _frame(0, HERE), _frame(30, BESIDE))
    assert len(closures) == 1 and registrar.counts()["keyframes"] == 2
    monkeypatch.undo()
    _run(registrar, _frame(60, AWAY))
    assert registrar.counts()["keyframes"] == 1


def test_a_gate_of_ones_own_decides_and_a_method_of_ones_own_is_asked() -> None:
    class Counting(Engine):
        asked = 0

        def propose(self, *pair: object) -> tuple:
            Counting.asked += 1
            return super().propose(*pair)  # type: ignore[arg-type]

    def never(candidates: object, prior: object = None) -> tuple[Reason, str]:
        return Reason.MOVED, "never"

    ours, _ = _run(Registrar(PARAMS, method=Counting(PARAMS)), _frame(0, HERE), _frame(30, BESIDE))
    assert ours and Counting.asked > 0
    closures, rejected = _run(Registrar(PARAMS, gate=never), _frame(0, HERE), _frame(30, BESIDE))
    assert not closures
    assert any(one.reason == Reason.MOVED and one.T_from_to is not None for one in rejected)


class Odometrical:
    """A method that proposes what odometry says; the gate doubts its poses of the keyframes at ``doubtful`` s."""

    def __init__(self, *doubtful: float) -> None:
        self._doubtful = {round(1e9 * seconds) for seconds in doubtful}

    def prepare(self, keyframe: object) -> None:
        """Nothing to make ready."""

    def propose(self, source: Any, target: Any, prior: object = None) -> tuple:
        doubts = {"correlation": 0.1, "tested": 2000, "perturbation_margin": 0.1}
        T = inverse(target.T_odom_camera) @ source.T_odom_camera
        pairs = tuple(
            ObjectPair(a, b, one.label)
            for a, one in enumerate(source.objects)
            for b, other in enumerate(target.objects)
            if one.label == other.label
        )
        return (candidate(T, matched=pairs[:2], **(doubts if source.stamp_ns in self._doubtful else {})),)


def _passes(*sides: float) -> list[Frame]:
    """A place from three sides, a look away, and the place again from as many."""
    places = [rooms.look_at((0.2, 0.2 * side, 1.3), (1.8, 0.0, 0.75)) for side in sides]
    there = [_frame(k, T, True) for k, T in enumerate(places)]
    return [*there, _frame(10, AWAY, True), *(_frame(30 + k, T, True) for k, T in enumerate(places))]


def test_what_a_keyframe_cannot_prove_is_published_late_with_its_own_stamps_when_others_agree() -> None:
    params = PARAMS.replaced(thin_seconds=0.1, closures=1, candidates=1)
    registrar = Registrar(params, method=Odometrical(30))
    outcomes = [registrar.process(frame) for frame in _passes(-1.0, 0.0, 1.0, 2.0)] + [registrar.finish()]
    by_keyframe = {o.keyframe_ns: [c.to_ns for c in o.closures] for o in outcomes if o.keyframe_ns is not None}
    first, second, third, fourth = (round(1e9 * seconds) for seconds in (30, 31, 32, 33))
    assert by_keyframe[first] == [] and by_keyframe[second] == [second] and by_keyframe[third] == [third]
    assert sorted(by_keyframe[fourth]) == [first, fourth]
    (late,) = [c for o in outcomes for c in o.closures if c.to_ns == first]
    assert late.evidence["agreeing"] == 3 and registrar.waiting == 0
    known = {landmark.landmark for landmark in registrar.landmarks}
    assert late.objects and {match.object_id for match in late.objects} <= known
    assert registrar.counts()["closures"] == sum(len(o.closures) for o in outcomes)


def test_what_nobody_confirms_is_refused_at_the_end_and_at_once_without_time_to_wait() -> None:
    for seconds, waiting in ((10.0, 1), (0.0, 0)):
        params = PARAMS.replaced(thin_seconds=0.1, closures=1, candidates=1, confirm_seconds=seconds)
        registrar = Registrar(params, method=Odometrical(30))
        for frame in _passes(0.0):
            registrar.process(frame)
        (window,) = registrar.end_windows()
        outcome = registrar.search(window)
        assert outcome.closures == () and registrar.waiting == waiting
        rejected = (*outcome.rejected, *registrar.settle().rejected)
        assert len([one for one in rejected if one.to_ns == round(30e9)]) == 1 and registrar.waiting == 0


def test_what_waits_is_refused_when_the_clock_begins_anew() -> None:
    params = PARAMS.replaced(thin_seconds=0.1, closures=1, candidates=1)
    registrar = Registrar(params, method=Odometrical(30))
    for frame in (*_passes(0.0), _frame(3, AWAY, True)):
        registrar.process(frame)
    assert registrar.waiting == 1
    outcome = registrar.finish()
    assert [one.to_ns for one in outcome.rejected if one.T_from_to is not None][:1] == [round(30e9)]
    assert registrar.waiting == 0


def test_a_moment_of_which_fusion_leaves_no_object_is_no_keyframe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "fuse", lambda window, params: replace(fuse(window, params), objects=()))
    registrar = Registrar(PARAMS)
    assert _run(registrar, _frame(0, HERE, True), _frame(30, BESIDE, True)) == ([], [])
    assert registrar.landmarks == ()


def test_live_parameters_hold_from_the_next_frame_and_the_next_search_on() -> None:
    registrar = Registrar(PARAMS)
    registrar.use_parameters(PARAMS.replaced(keyframe_translation=9.0, keyframe_rotation=180.0, keyframe_seconds=99.0))
    assert registrar.track(_frame(0, HERE, True)) is None and registrar.track(_frame(1, AWAY, True)) is None
    registrar.use_parameters(PARAMS)
    window = registrar.track(_frame(2, BESIDE, True))
    registrar.search(window)
    registrar.use_parameters(PARAMS.replaced(min_gap=60.0))
    closures, rejected = _run(registrar, _frame(50, HERE, True))
    assert not closures and {refusal.reason for refusal in rejected} == {Reason.NO_CANDIDATE}


def test_odds_that_are_asked_for_live_hold_for_our_gate_and_leave_one_of_ones_own() -> None:
    asked: list[int] = []

    def welcoming(candidates: Any, prior: Any) -> Any:
        asked.append(len(candidates))
        return candidates[0]

    for gate, found in ((None, 0), (welcoming, 1)):
        registrar = Registrar(PARAMS, gate=gate)
        registrar.process(_frame(0, HERE))
        registrar.use_parameters(PARAMS.replaced(least_odds=1e6))
        assert len(_run(registrar, _frame(30, BESIDE))[0]) == found
    assert asked


def _of(robot: str, frame: Frame, frame_id: str = "camera") -> Frame:
    return replace(frame, robot=robot, frame_id=frame_id)


def test_robots_that_see_one_place_at_the_same_time_close_a_loop_that_names_both() -> None:
    frames = [_of("robot1", _frame(30.0, HERE, True)), _of("robot2", _frame(30.0, BESIDE, True))]
    registrar = Registrar(PARAMS)
    closures, rejected = _run(registrar, *frames)
    (closure,) = closures
    assert closure.robots == ("robot1", "robot2") and (closure.from_session, closure.to_session) == (0, 1)
    assert (closure.from_ns, closure.to_ns) == (30 * SECOND, 30 * SECOND)
    rotation, distance = pose_error(closure.T_from_to, inverse(HERE) @ BESIDE)
    assert rotation < 1.0 and distance < 2.0
    assert not [refusal for refusal in rejected if refusal.reason is Reason.CLOCK]


def test_a_robot_that_starts_while_another_drives_hides_nothing_of_it() -> None:
    first = [_of("robot1", _frame(t, T, True)) for t, T in ((10.0, HERE), (60.0, AWAY))]
    closures, rejected = _run(Registrar(PARAMS), *first, _of("robot2", _frame(20.0, BESIDE, True)))
    assert (("robot1", "robot2"), 10 * SECOND) in [(closure.robots, closure.from_ns) for closure in closures]
    assert not [refusal for refusal in rejected if refusal.reason is Reason.CLOCK]


def test_two_cameras_of_one_robot_are_followed_beside_each_other() -> None:
    turns = [(0.0, HERE, "front"), (0.01, AWAY, "rear"), (1.0, HERE, "front"), (1.01, AWAY, "rear")]
    registrar = Registrar(PARAMS)
    _run(registrar, *(_of("robot1", _frame(t, T, True), camera) for t, T, camera in turns))
    assert registrar.counts()["sessions"] == 2
    closures, _ = _run(registrar, _of("robot1", _frame(30.0, BESIDE, True), "rear"))
    assert ("front", "rear") in [(closure.from_frame_id, closure.to_frame_id) for closure in closures]


def _arrived(registrar: Registrar, seconds: float, T: Array, robot: str, run: str) -> Outcome | None:
    """What becomes of a keyframe that a robot has made by itself."""
    elsewhere = Registrar(PARAMS)
    elsewhere.track(_of(robot, _frame(seconds, T, True)))
    (window,) = elsewhere.end_windows()
    elsewhere.close()
    return registrar.receive_keyframe(Arrival(fuse(window, PARAMS), window.clock, run))


def test_of_a_keyframe_from_elsewhere_without_objects_nothing_comes() -> None:
    registrar = Registrar(PARAMS)
    bare = replace(rooms.keyframe(HERE), objects=(), robot="robot1")
    assert registrar.receive_keyframe(Arrival(bare, Clock(0, 0), "a")) == Outcome()
    assert registrar.counts()["keyframes"] == 0


def test_keyframes_from_elsewhere_close_loops_and_are_taken_once_though_the_registrar_starts_anew(
    tmp_path: Path,
) -> None:
    params = PARAMS.replaced(store=str(tmp_path / "place.db"))
    registrar = Registrar(params)
    assert _arrived(registrar, 30.0, HERE, "robot1", "a").closures == ()  # type: ignore[union-attr]
    assert _arrived(registrar, 30.0, HERE, "robot1", "a") is None
    registrar.close()
    registrar = Registrar(params)
    assert _arrived(registrar, 30.0, HERE, "robot1", "a") is None
    (closure,) = _arrived(registrar, 31.0, BESIDE, "robot2", "b").closures  # type: ignore[union-attr]
    assert closure.robots == ("robot1", "robot2")
    assert [stored.robots for stored in registrar._store.closures()] == [("robot1", "robot2")]
    registrar.close()


def test_what_a_person_withdrew_is_not_found_again_until_that_is_taken_back(tmp_path: Path) -> None:
    store = tmp_path / "place.db"
    registrar = Registrar(PARAMS.replaced(store=str(store), thin_seconds=0.1))
    closures, _ = _run(registrar, _frame(0, HERE, True), _frame(1, AWAY, True), _frame(30, BESIDE, True))
    ids = [closure_id(one, "r1") for one in closures]
    with pytest.raises(ValueError, match="ids: expected those of stored closures, got nothing"):
        registrar.veto([*ids, "nothing"], "r1")
    vetoed = registrar.veto(ids, "r1")
    assert vetoed.withdrawn == tuple(registrar.vetoed) and len(vetoed.withdrawn) == len(ids)
    assert registrar.counts()["closures"] == 0 and registrar.counts()["vetoed"] == len(ids)
    again, rejected = _run(registrar, _frame(32, BESIDE, True), _frame(33, AWAY, True))
    assert [c for c in again if c.from_ns == 0 and c.to_ns >= 30 * SECOND] == []
    assert Reason.VETOED in {one.reason for one in rejected}
    registrar.close()
    registrar = Registrar(PARAMS.replaced(store=str(store), thin_seconds=0.1))
    assert len(registrar.vetoed) == len(ids)
    back = registrar.undo_veto(ids, "r1")
    assert [closure_id(one, "r1") for one in back.closures] == ids and registrar.vetoed == ()
    assert registrar.counts()["closures"] >= len(ids) and registrar.counts()["vetoed"] == 0
    with pytest.raises(ValueError, match="withdrawn closures"):
        registrar.undo_veto(ids, "r1")
    registrar.close()
