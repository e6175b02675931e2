# SPDX-License-Identifier: Apache-2.0
"""How the odometry of a robot is followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_mapper.follower import Follower, Followers
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.geometry import pose

from .bent import SECOND, odometry, square

WALK = odometry(square())


def followed(graph: PoseGraph, robot: str, leaps: list[str] | None = None, frame_id: str = "odom") -> Follower:
    said = [] if leaps is None else leaps
    follower = Follower(robot, 5.0, lambda: said.append(robot))
    for sample in WALK[:20]:
        for admitted in follower.admit(replace(sample, frame_id=frame_id)).poses:
            follower.follow_pose(admitted, graph)
    return follower


def test_poses_come_into_the_graph_as_those_of_the_robot() -> None:
    graph = PoseGraph()
    one, other = followed(graph, "a"), followed(graph, "b")
    assert [session.robot for session in graph.sessions] == ["a", "b"]
    assert one.has_news and one.newest is not None and one.newest.stamp_ns == WALK[19].stamp_ns
    keyframes = len(graph.sessions[0].keyframes)
    counts = Followers(a=one, b=other).counts(graph)
    assert counts["odometry"] == {"a": 20, "b": 20} and counts["passed_over"] == {"a": 0, "b": 0}
    assert counts["placed"] == {"a": True, "b": False} and counts["keyframes"]["a"] == keyframes > 5


def test_a_pose_that_leaps_is_reported_and_one_that_comes_late_is_counted() -> None:
    leaps: list[str] = []
    follower = followed(PoseGraph(), "a", leaps)
    away = replace(WALK[20], T_odom_body=pose(np.eye(3), np.array([30.0, 0.0, 0.0])))
    for sample in (away, WALK[21], WALK[15]):
        follower.admit(sample)
    assert leaps == ["a"] and follower.passed_over_count == 2


def test_after_time_jumped_back_what_was_found_before_is_of_the_old_run() -> None:
    graph = PoseGraph()
    follower = followed(graph, "a")
    assert not follower.is_of_old_run(int(1.5 * SECOND))
    assert follower.jump_back(0) == pytest.approx(1.9)
    follower.follow_pose(WALK[0], PoseGraph())
    assert follower.is_of_old_run(int(1.5 * SECOND)) and not follower.is_of_old_run(3 * SECOND)


def test_two_runs_of_a_clock_are_confusable_where_no_session_is_named_and_no_other_robot_is_in_the_map() -> None:
    graph = PoseGraph()
    follower = followed(graph, "a")
    assert follower.is_confusable(graph)
    graph.sessions.learn(0, 7)
    assert not follower.is_confusable(graph)
    graph.sessions[0].names.clear()
    followed(graph, "b")
    assert not follower.is_confusable(graph)


def test_frames_of_one_name_are_shared() -> None:
    graph = PoseGraph()
    frames = {"a": "odom", "b": "odom", "c": "c/odom"}
    followers = Followers({robot: followed(graph, robot, frame_id=frame) for robot, frame in frames.items()})
    assert [followers.share_frame(one) for one in followers.values()] == [True, True, False]
    assert [len(followers.meant(robot)) for robot in ("a", "", "x")] == [1, 3, 3]
