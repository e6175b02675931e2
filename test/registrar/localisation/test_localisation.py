# SPDX-License-Identifier: Apache-2.0
"""A later session that goes along x beside an earlier one's map, and is taken elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from registration.samples import SECOND, box, frame, keyframe, moved

from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.localisation import LocalisationState, State
from objreg_ros.geometry import inverse
from objreg_ros.memory.known import Last, last_of
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.veto import Veto
from objreg_ros.registrar.localisation.expectation import Look
from objreg_ros.registrar.localisation.localisation import SHOWN_NS, Localisation
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.relocalisation import Relocalisation
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration.keyframe import Keyframe, KeyObject

EARLIER, NOW = 3, 5
TIGHT = np.diag([0.01**2] * 3 + [0.005**2] * 3)
TAKEN = moved(0.0, 0.0, 4.0)  # T_map_odom after it was


class Walk:
    """The camera, a keyframe every 20 cm and second."""

    def __init__(self) -> None:
        self.relocalisation = Relocalisation()
        self.here = Localisation(RegistrarParams(), self.relocalisation)
        self.step = 0

    def go(self, known: list[tuple[int, Last, int]] | None = None, *objects: str) -> Keyframe:
        """On to the next keyframe, which shows objects a metre ahead."""
        self.step += 1
        seconds, metres = 100.0 + self.step, 0.2 * self.step
        self.relocalisation.note_frame(frame(seconds, T_odom_camera=moved(metres)), NOW)
        shown = tuple(KeyObject(cloud=box(label, (0.3 * k, 0.0, 1.0))) for k, label in enumerate(objects))
        made = replace(keyframe(self.step, seconds, (), NOW), objects=shown)
        made = replace(made, T_odom_camera=moved(metres), travelled=metres, by_odometry=True)
        self.here.expect(made, known or [])
        return made

    def close(self, source: Keyframe, taken: np.ndarray, odds: float = 200.0) -> LoopClosure:
        """A closure to the keyframe of the earlier session that is beside where the camera is."""
        T_map_source = taken @ moved(source.travelled)
        target = replace(keyframe(900 + self.step, 0.2 * self.step, (), EARLIER), by_odometry=True)
        target = replace(target, T_odom_camera=T_map_source @ moved(0.1), travelled=source.travelled)
        closure = LoopClosure(
            from_ns=target.stamp_ns,
            to_ns=source.stamp_ns,
            T_from_to=inverse(moved(0.1)),
            covariance=TIGHT,
            labels=(),
            evidence={"odds": odds},
            from_session=EARLIER,
            to_session=NOW,
        )
        self.here.add_closure(closure, source, target)
        self.relocalisation.add_closure(closure, source, target)
        return closure

    def veto(self, *closures: LoopClosure) -> None:
        """A person withdraws these."""
        self.relocalisation.withdraw(closures)
        self.here.withdraw(Vetoes(Veto(closure=one) for one in closures))

    @property
    def now(self) -> LocalisationState:
        return self.here.state(self.relocalisation.newest_ns)


def known(*landmarks: int, session: int = NOW, ahead: float = 0.0) -> list[tuple[int, Last, int]]:
    """Cups that stand a metre ahead of the walk's beginning, 20 cm apart, and before a wall."""
    seen = replace(
        keyframe(1, 101.0, (), session),
        objects=tuple(KeyObject(cloud=box("cup", (ahead + 0.2 * k, -0.1, 1.0))) for k in range(len(landmarks))),
        T_odom_camera=np.eye(4),
        travelled=0.0,
        by_odometry=True,
    )
    return [(n, last_of(one), 3) for n, one in zip(landmarks, sightings_of(seen), strict=True)]


def tied() -> Walk:
    walk = Walk()
    for _ in range(3):
        walk.close(walk.go(), np.eye(4))
    return walk


def test_it_tracks_until_a_map_is_tied_and_then_is_sure() -> None:
    walk = Walk()
    walk.close(walk.go(), np.eye(4))
    assert walk.now.state is State.TRACKING and np.isnan(walk.now.probability)
    walk.close(walk.go(), np.eye(4))
    walk.close(walk.go(), np.eye(4))
    now = walk.now
    assert now.state is State.SURE and now.probability > 0.95 and now.age_s == 0.0 and now.closure is not None


def test_it_is_unsure_once_odometry_has_drifted() -> None:
    walk = tied()
    for _ in range(40):  # 8 m
        walk.go()
    now = walk.now
    assert now.state is State.UNSURE and now.sigma_m > 0.2 and now.age_s == 40.0


def test_one_closure_that_contradicts_is_doubt_and_two_that_agree_are_a_kidnapping() -> None:
    walk = tied()
    walk.close(walk.go(), TAKEN)
    assert walk.now.state in (State.SURE, State.UNSURE) and walk.now.odds < 100.0
    walk.close(walk.go(), TAKEN)
    now = walk.now
    assert now.state is State.KIDNAPPED and "4.00 m" in now.reason
    found = walk.relocalisation.relocalised
    assert found is not None and np.allclose(found.T_map_odom, TAKEN, atol=1e-6)


def test_a_kidnapping_is_said_for_a_while_and_then_it_is_sure_of_the_other_place() -> None:
    walk = tied()
    for _ in range(2):
        walk.close(walk.go(), TAKEN)
    while walk.relocalisation.newest_ns <= 104 * SECOND + SHOWN_NS:
        walk.close(walk.go(), TAKEN)
        assert walk.now.state is State.KIDNAPPED
    walk.go()
    assert walk.now.state is State.SURE


def test_two_that_contradict_odometry_and_each_other_are_no_kidnapping() -> None:
    walk = tied()
    walk.close(walk.go(), TAKEN)
    walk.close(walk.go(), moved(0.0, 3.0, 0.0))
    assert walk.now.state is State.LOST


def test_one_that_agrees_again_ends_the_doubt() -> None:
    walk = tied()
    walk.close(walk.go(), TAKEN)
    walk.close(walk.go(), np.eye(4))
    assert walk.now.state is State.SURE and walk.now.odds > 1000.0


def test_one_missing_object_is_not_lost_and_many_in_many_keyframes_are() -> None:
    walk = Walk()
    walk.go()
    for _ in range(8):  # the same one again adds nothing
        walk.go(known(1))
    assert walk.now.state is State.TRACKING
    other = Walk()
    other.go()
    other.go(known(11, 12, 13, 14))
    assert other.now.state is State.TRACKING  # looks of one keyframe err together
    for k in range(2, 8):
        other.go(known(*(10 * k + n for n in range(4)), ahead=0.2 * k))
    assert other.now.state is State.LOST and "16 known objects are missing" in other.now.reason


def test_objects_of_another_session_are_expected_only_where_its_map_is_tied() -> None:
    walk = Walk()
    walk.go()
    assert walk.here.expect(walk.go(), known(1, session=EARLIER)) == []
    ties = tied()
    (found,) = ties.here.expect(ties.go(), known(1, session=EARLIER, ahead=0.8))
    assert found[1] is Look.MISSING


def test_another_session_begins_anew() -> None:
    walk = Walk()
    walk.go()
    for k in range(1, 8):
        walk.go(known(*(10 * k + n for n in range(4)), ahead=0.2 * k))
    assert walk.now.state is State.LOST
    walk.here.expect(replace(walk.go(), session=NOW + 1), [])
    assert walk.now.state is State.TRACKING


def test_closures_among_keyframes_after_a_kidnapping_do_not_hide_it() -> None:
    walk = tied()
    first = walk.go()
    walk.close(first, TAKEN)
    second = walk.go()
    one = LoopClosure(
        from_ns=first.stamp_ns,
        to_ns=second.stamp_ns,
        T_from_to=moved(0.2),
        covariance=TIGHT,
        labels=(),
        evidence={"odds": 900.0},
        from_session=NOW,
        to_session=NOW,
    )
    walk.here.add_closure(one, second, first)
    walk.close(second, TAKEN)
    assert walk.now.state is State.KIDNAPPED


def test_closures_to_keyframes_of_seconds_ago_do_not_make_it_surer() -> None:
    walk = tied()
    walk.close(walk.go(), TAKEN)
    before, first, second = walk.now.odds, walk.go(), walk.go()
    walk.here.add_rival(second, first, moved(0.2), 900.0)
    assert walk.now.odds <= before


def test_a_keyframe_that_shows_none_of_what_it_should_is_searched_without_odometry() -> None:
    walk = Walk()
    walk.go()
    walk.go(known(1, 2), "cup")
    assert not walk.here.is_doubtful
    walk.go(known(1, 2, ahead=0.4))
    assert walk.here.is_doubtful


def test_objects_that_are_not_detected_never_make_it_lost() -> None:
    walk = Walk()
    walk.go()
    hidden = known(1, 2, 3, 4, session=NOW, ahead=0.0)
    for _ in range(60):
        made = walk.go()
        walk.here._weigh([(place, Look.NOTHING) for place, _ in walk.here.expect(made, hidden)], made.stamp_ns)
    assert walk.now.state is State.TRACKING


def test_places_that_fit_alike_leave_it_ambiguous_until_a_closure_to_a_map_or_another_session() -> None:
    walk = Walk()
    made = walk.go()
    walk.here.set_alike("nothing decides")
    walk.here.set_alike("")  # a keyframe that fits no place
    assert walk.now.state is State.AMBIGUOUS and "nothing decides" in walk.now.reason
    walk.close(made, np.eye(4))
    assert walk.now.state is not State.AMBIGUOUS
    walk.here.set_alike("nothing decides")
    walk.here.expect(replace(keyframe(90, 900.0, (), NOW + 1), by_odometry=True), [])
    assert walk.now.state is not State.AMBIGUOUS


def test_after_a_veto_of_all_that_ties_it_it_tracks_with_no_closure_and_no_more_surely_than_before() -> None:
    walk, untied = Walk(), Walk()
    closures = [walk.close(walk.go(), np.eye(4)) for _ in range(3)]
    for _ in range(3):
        untied.go()
    assert walk.now.state is State.SURE and walk.now.odds > 10.0 * untied.now.odds
    walk.veto(*closures)
    now = walk.now
    assert now.state is State.TRACKING and now.closure is None and np.isnan(now.probability)
    assert np.isclose(now.odds, untied.now.odds, rtol=1e-6) and walk.here.sessions() == {NOW}


def test_after_a_veto_it_rests_on_what_remains() -> None:
    walk, without = tied(), tied()
    false = walk.close(walk.go(), moved(0.05))
    without.go()
    for one in (walk, without):
        one.close(one.go(), np.eye(4))
    walk.veto(false)
    found, expected = walk.relocalisation.relocalised, without.relocalisation.relocalised
    assert found is not None and expected is not None and found.closures == expected.closures
    assert np.allclose(found.T_map_odom, np.eye(4)) and np.allclose(found.covariance, expected.covariance)
    assert walk.now.state is State.SURE and np.isclose(walk.now.odds, without.now.odds)
    assert walk.now.closure is not None and walk.now.sigma_m == without.now.sigma_m


def test_after_a_veto_of_those_that_had_it_taken_elsewhere_it_is_where_it_was_tied_before() -> None:
    walk = tied()
    false = [walk.close(walk.go(), TAKEN) for _ in range(2)]
    assert walk.now.state is State.KIDNAPPED
    walk.veto(*false)
    now, found = walk.now, walk.relocalisation.relocalised
    assert now.state is State.SURE and "contradict" in now.reason and walk.here.since_ns == 101 * SECOND
    assert found is not None and found.closures == 3 and np.allclose(found.T_map_odom, np.eye(4))


def test_one_that_is_left_of_two_that_had_it_taken_elsewhere_is_doubt() -> None:
    walk = tied()
    first, _ = (walk.close(walk.go(), TAKEN) for _ in range(2))
    walk.veto(first)
    now = walk.now
    assert now.state in (State.SURE, State.UNSURE, State.LOST) and "1 closures contradict" in now.reason
    walk.close(walk.go(), TAKEN)
    assert walk.now.state is State.KIDNAPPED and walk.now.reason.startswith("2 closures")


def test_a_withdrawn_rival_counts_no_more() -> None:
    walk = tied()
    walk.veto(walk.close(walk.go(), TAKEN))
    assert walk.now.state is State.SURE and "0 closures contradict" in walk.now.reason
    walk.close(walk.go(), TAKEN)
    assert walk.now.state is not State.KIDNAPPED and "1 closures contradict" in walk.now.reason


def test_without_a_false_tie_those_that_contradicted_it_are_the_tie_and_no_kidnapping() -> None:
    walk = Walk()
    false = walk.close(walk.go(), TAKEN, odds=2000.0)
    assert walk.now.state is State.SURE
    walk.close(walk.go(), np.eye(4), odds=2000.0)
    walk.veto(false)
    walk.close(walk.go(), np.eye(4), odds=2000.0)
    now, found = walk.now, walk.relocalisation.relocalised
    assert now.state is State.SURE and "0 closures contradict" in now.reason
    assert found is not None and found.closures == 2 and np.allclose(found.T_map_odom, np.eye(4))


def test_a_kidnapping_that_rests_on_others_stays_after_a_veto() -> None:
    walk = Walk()
    false = walk.close(walk.go(), np.eye(4))
    for _ in range(2):
        walk.close(walk.go(), np.eye(4))
    for _ in range(2):
        walk.close(walk.go(), TAKEN)
    walk.veto(false)
    found = walk.relocalisation.relocalised
    assert walk.now.state is State.KIDNAPPED and walk.here.since_ns == 104 * SECOND
    assert found is not None and np.allclose(found.T_map_odom, TAKEN)


def test_a_veto_of_closures_that_are_none_of_this_camera_changes_nothing() -> None:
    walk, other = tied(), Walk()
    walk.go(known(1, 2, 3))
    before = walk.now
    other.step = 50
    walk.veto(other.close(other.go(), np.eye(4)))
    assert walk.now.odds == before.odds and walk.now.closure is before.closure and walk.now.reason == before.reason


def test_a_pose_that_was_found_without_odometry_goes_with_the_veto_of_its_pair() -> None:
    walk = tied()
    old = walk.go()
    for _ in range(11):
        walk.go()
    here = walk.go()
    walk.here.add_rival(here, old, moved(0.0, 0.0, 4.0), 500.0)
    assert "1 closures contradict" in walk.now.reason
    closure = LoopClosure(
        from_ns=old.stamp_ns,
        to_ns=here.stamp_ns,
        T_from_to=moved(0.0, 0.0, 4.0),
        covariance=TIGHT,
        labels=(),
        from_session=NOW,
        to_session=NOW,
    )
    walk.veto(closure)
    assert "0 closures contradict" in walk.now.reason


def test_a_closure_that_holds_again_ties_it_again() -> None:
    walk = Walk()
    source = walk.go()
    closure = walk.close(source, np.eye(4), odds=2000.0)
    target = replace(keyframe(901, 0.2, (), EARLIER), by_odometry=True, travelled=source.travelled)
    target = replace(target, T_odom_camera=moved(source.travelled + 0.1))
    walk.veto(closure)
    assert walk.now.state is State.TRACKING
    walk.relocalisation.add_closure(closure, source, target)
    walk.here.admit(closure, source, target)
    assert walk.now.state is State.SURE and walk.now.closure is closure
