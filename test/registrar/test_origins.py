# SPDX-License-Identifier: Apache-2.0
"""Keyframes that were made elsewhere: each is received once, under numbers that last."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from registration.samples import SECOND, keyframe

from objreg_ros.keyframes.frame_window import Arrival, Clock, SessionNumbers
from objreg_ros.memory.compact import pack_keyframe
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.origins import Origins, arrival_of


def _arrival(run: str, seconds: float, session: int = 0, robot: str = "robot1") -> Arrival:
    made = replace(keyframe(0, seconds, session=session), robot=robot)
    return Arrival(made, Clock(0, 0), run)


def _sessions(origins: Origins, *arrivals: Arrival) -> list[int | None]:
    found = [origins.received(arrival) for arrival in arrivals]
    return [None if one is None else one[0].session for one in found]


def test_sessions_of_different_runs_get_numbers_of_their_own_that_stay() -> None:
    origins = Origins(Store(), SessionNumbers(5))
    numbers = _sessions(
        origins, _arrival("a", 1), _arrival("b", 1, robot="robot2"), _arrival("a", 2), _arrival("a", 3, 1)
    )
    assert numbers == [5, 6, 5, 7]


def test_what_one_robot_sent_and_is_played_as_anothers_is_of_that_ones_own_session() -> None:
    origins = Origins(Store(), SessionNumbers())
    assert _sessions(origins, _arrival("a", 1), _arrival("a", 1, robot="robot2"), _arrival("a", 2)) == [0, 1, 0]


def test_what_comes_again_or_late_is_not_received_again() -> None:
    origins = Origins(Store(), SessionNumbers())
    assert _sessions(origins, *(_arrival("a", s) for s in (1, 2, 1, 2, 3))) == [0, 0, None, None, 0]


def test_a_clock_keeps_its_first_session_though_that_was_never_received() -> None:
    origins = Origins(Store(), SessionNumbers())
    first, second = origins.received(_arrival("a", 1, session=4)), origins.received(_arrival("a", 2, session=6))
    assert first is not None and second is not None
    assert first[1] == second[1] == Clock(0, 0) and (first[0].session, second[0].session) == (1, 2)


def test_a_store_that_is_opened_anew_goes_on_with_the_same_sessions_and_knows_what_it_has() -> None:
    store = Store()
    received = Origins(store, SessionNumbers(3)).received(_arrival("a", 5))
    assert received is not None
    stored = received[0].numbered(1)
    store.write_keyframe(stored, sightings_of(stored))
    again = Origins(store, SessionNumbers(store.next_session()))
    assert _sessions(again, _arrival("a", 5), _arrival("a", 6), _arrival("c", 6)) == [None, 3, 4]
    assert again.received(_arrival("a", 7))[1] == Clock(0, 3)  # type: ignore[index]
    assert stored.stamp_ns == 5 * SECOND and stored.origin == "robot1 a/0"


@pytest.mark.parametrize("wrong", [{}, {"stamp_ns": 6 * SECOND}, {"frame_id": "other"}])
def test_what_is_packed_is_what_the_header_says_and_comes_under_the_robots_prefix(wrong: dict[str, object]) -> None:
    header = {"stamp_ns": 5 * SECOND, "frame_id": "camera", "run": "a", "began_ns": 0, "first": 0, **wrong}
    sent = SimpleNamespace(**header, packed=pack_keyframe(keyframe(0, 5)))
    if wrong:
        with pytest.raises(ValueError, match="expected the stamp and frame"):
            arrival_of("robot1", sent)
        return
    arrived = arrival_of("robot1", sent).keyframe
    assert (arrived.robot, arrived.frame_id, arrived.stamp_ns) == ("robot1", "robot1/camera", 5 * SECOND)
