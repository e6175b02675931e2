# SPDX-License-Identifier: Apache-2.0
"""Which session a moment is of, among those of several robots."""

from __future__ import annotations

from dataclasses import replace

import pytest

from objreg_mapper.params import MapperParams
from objreg_mapper.sessions import Sessions, StampedFrame, moments_of

from .bent import SECOND, closure, odometry, square

WALK = odometry(square())


def driven(*runs: tuple[str, int, int]) -> Sessions:
    """Sessions of these robots with the poses from one number to another, by one clock."""
    sessions = Sessions()
    for robot, first, last in runs:
        sessions.begin_session(robot=robot)
        for sample in WALK[first:last]:
            sessions[-1].add_pose(sample, MapperParams())
    return sessions


def at(robot: str, step: int, name: int | None = None) -> StampedFrame:
    return StampedFrame(robot, name, step * SECOND // 10)


def test_a_moment_is_of_its_robot_s_session() -> None:
    sessions = driven(("a", 0, 50), ("b", 0, 50))
    assert (sessions.of(at("a", 20)), sessions.of(at("b", 20)), sessions.of(at("c", 20))) == (0, 1, None)


def test_a_moment_of_no_robot_is_of_the_only_session_that_may_have_it() -> None:
    assert driven(("a", 0, 50), ("b", 60, 80)).of(at("", 40)) == 0
    with pytest.raises(ValueError, match="names its sessions"):
        driven(("a", 0, 50), ("b", 0, 20)).of(at("", 40))  # b has yet to come there


def test_a_robot_s_name_is_no_matter_to_an_odometry_without_one() -> None:
    assert driven(("", 0, 50)).of(at("x", 20)) == 0


def test_odometry_goes_on_in_the_robot_s_newest_session_that_is_not_over() -> None:
    sessions = driven(("a", 0, 20), ("b", 0, 20), ("a", 30, 50))
    assert [sessions.newest(robot) for robot in "abc"] == [2, 1, None]
    sessions[2].is_over = sessions[1].is_over = True
    assert [sessions.newest(robot) for robot in "abc"] == [0, None, None]


def test_a_session_without_odometry_gives_way_to_the_next_robot_s() -> None:
    sessions = driven(("a", 0, 20), ("b", 0, 0), ("c", 0, 20))
    assert [one.robot for one in sessions] == ["a", "c"]


def test_a_moment_in_a_gap_or_before_odometry_will_never_come() -> None:
    sessions = driven(("a", 10, 30))
    for k in range(3):
        sessions[0].add_pose(replace(WALK[30 + k], stamp_ns=(200 + k) * SECOND // 10), MapperParams())
    assert sessions.in_gap(at("a", 100)) and not sessions.is_before_odometry(at("a", 100))
    assert sessions.is_before_odometry(at("a", 5)) and not sessions.in_gap(at("a", 5))
    assert not any(lost(at("a", 400)) for lost in (sessions.in_gap, sessions.is_before_odometry))
    assert not any(lost(at("b", 100)) for lost in (sessions.in_gap, sessions.is_before_odometry))  # b may come


def test_a_moment_that_another_robot_may_have_is_not_lost_in_a_gap_of_the_first() -> None:
    sessions = driven(("a", 10, 30), ("b", 0, 10))
    for k in range(3):
        sessions[0].add_pose(replace(WALK[30 + k], stamp_ns=(200 + k) * SECOND // 10), MapperParams())
    assert sessions.in_gap(at("a", 100)) and not sessions.in_gap(at("", 100))


def test_the_ends_of_a_closure_have_each_their_robot_and_session() -> None:
    closed = replace(closure(square(), 1, 2), from_robot="a", to_robot="b", from_session=3, to_session=4)
    assert moments_of(closed) == (at("a", 1, 3), at("b", 2, 4))


def test_what_is_known_of_a_closure_names_sessions_of_both_robots() -> None:
    sessions = driven(("a", 0, 50), ("b", 0, 50))
    closed = replace(closure(square(), 1, 2), from_robot="a", to_robot="b", from_session=3, to_session=4)
    sessions.learn_from(closed)
    assert [one.names for one in sessions] == [{3}, {4}]
