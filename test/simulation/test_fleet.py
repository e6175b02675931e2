# SPDX-License-Identifier: Apache-2.0
"""Plans of several robots: one world, one clock, shared places and different ways."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.fleet import make_fleet
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.scenarios import RecordingPlan

from .motions import speeds

SMALL = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)
FRAMES = 48


@cache
def robots() -> list[RecordingPlan]:
    return make_fleet("robots", 0, FRAMES)  # three rooms take a second


@cache
def views(robot: int) -> list[Rendering]:
    plan = robots()[robot]
    return [render(plan.scenes[0], T, SMALL, with_colour=False) for T in plan.T_world_camera[::4]]


def seen_on_tables(robot: int) -> list[set[int]]:
    """For each table the instances on it that a robot sees in some of its frames."""
    scene = robots()[robot].scenes[0]
    on = [
        {o.instance for o in scene.objects if np.linalg.norm(o.T_world_object[:3, 3] - place.centre) < place.reach}
        for place in scene.places
    ]
    seen = {o.instance for view in views(robot) for o in view.seen if o.pixels > 60}
    return [instances & seen for instances in on]


def test_robots_move_at_the_speed_of_a_hand_and_by_one_rate() -> None:
    assert len(robots()) == 3 and len({plan.rate for plan in robots()}) == 1
    for plan in robots():
        moved, turned = speeds(plan.T_world_camera, plan.rate)
        assert len(plan) == FRAMES and moved.max() < 0.55 and turned.max() < 45.0


def test_each_robot_begins_a_third_of_a_way_after_the_one_before() -> None:
    way_ns = FRAMES / robots()[0].rate * 1e9
    assert [plan.start_ns / way_ns for plan in robots()] == pytest.approx([0, 1 / 3, 2 / 3], abs=1e-6)
    assert [plan.robot for plan in robots()] == ["robot1", "robot2", "robot3"]


@pytest.mark.parametrize(("a", "b"), [*combinations(range(3), 2)])
def test_each_pair_of_robots_sees_the_same_objects_of_a_table(a: int, b: int) -> None:
    shared = [len(ours & theirs) for ours, theirs in zip(seen_on_tables(a), seen_on_tables(b), strict=True)]
    assert max(shared) >= 3


def test_no_robot_sees_what_all_see_alone() -> None:
    """The first never comes to the last room, the second never to the first, and the third goes to all."""
    visited = [
        [min(np.linalg.norm(plan.T_world_camera[:, :2, 3] - p.centre[:2], axis=1)) < 1.5 for p in plan.scenes[0].places]
        for plan in robots()
    ]
    assert visited == [[True, True, False], [False, True, True], [True, True, True]]


def test_nobody_walks_through_a_wall_or_a_table() -> None:
    for robot in range(3):
        for view in views(robot):
            assert np.quantile(view.true_depth[view.true_depth > 0], 0.2) > 0.4


def test_all_robots_are_in_one_world() -> None:
    assert len({id(plan.scenes[0]) for plan in robots()}) == 1


def test_an_unknown_scenario_is_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="expected one of robots, got 'loop'"):
        make_fleet("loop", 0)
