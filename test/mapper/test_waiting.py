# SPDX-License-Identifier: Apache-2.0
"""What becomes of a closure at the mapper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_mapper.follower import Follower, Followers
from objreg_mapper.pose_graph import PoseGraph
from objreg_mapper.waiting import ClosureQueue
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose

from .bent import closure, odometry, square

TRUE = square(per_side=12, laps=2)


def driven(
    robots: tuple[str, ...] = ("",), steps: range = range(len(TRUE))
) -> tuple[PoseGraph, ClosureQueue, list[str]]:
    """A graph, what waits for it, and the bodies that a camera was looked for on."""
    graph, bodies = PoseGraph(), list[str]()
    followers = Followers({robot: Follower(robot, 5.0, lambda: None) for robot in robots})
    for sample in (odometry(TRUE)[k] for k in steps):
        for robot, follower in followers.items():
            follower.follow_pose(replace(sample, child_frame_id=f"{robot}/base"), graph)

    def find_mount(samples: list, frame_id: str) -> Array | None:
        bodies.append(samples[0].child_frame_id)
        return None

    return graph, ClosureQueue(followers, find_mount, most=2), bodies


def of(closed: LoopClosure, one: str, other: str) -> LoopClosure:
    return replace(closed, from_robot=one, to_robot=other)


def test_a_closure_whose_odometry_is_there_is_tied_by_the_bodies_of_its_robots() -> None:
    graph, waiting, bodies = driven(("a", "b"))
    waiting.closures = [of(closure(TRUE, 10, 90), "a", "b")]
    assert [fate.reason for fate in waiting.tie(graph)] == [""] and len(graph.closure_ties) == 1
    assert bodies == ["a/base", "b/base"] and not waiting.closures


@pytest.mark.parametrize(
    ("refused", "reason"),
    [
        (closure(TRUE, 10, 5), "two_clocks"),
        (closure(TRUE, 10, 90, pose(np.eye(3), np.array([50.0, 0.0, 0.0]))), "implausible"),
        (closure(TRUE, -10, 90), "before_odometry"),
        (of(closure(TRUE, 10, 90), "x", "y"), "unknown_robot"),
    ],
)
def test_a_closure_that_cannot_be_used_is_refused_by_reason(refused: LoopClosure, reason: str) -> None:
    graph, waiting, _ = driven()
    waiting.closures = [refused]
    assert [fate.reason for fate in waiting.tie(graph)] == [reason] and not graph.closure_ties


def test_a_robot_that_nobody_follows_is_named() -> None:
    graph, waiting, _ = driven(("a", "b"))
    waiting.closures = [of(closure(TRUE, 10, 90), "a", "c")]
    (fate,) = waiting.tie(graph)
    assert fate.reason == "unknown_robot" and "expected robots of a, b, got c" in fate.text


def test_closures_wait_until_too_many_do() -> None:
    graph, waiting, _ = driven(steps=range(20))
    waiting.closures = ahead = [closure(TRUE, k, 90) for k in (5, 6)]
    assert waiting.tie(graph) == [] and waiting.closures == ahead
    waiting.closures.append(closure(TRUE, 7, 90))
    assert [(fate.closure, fate.reason) for fate in waiting.tie(graph)] == [(ahead[0], "queue_full")]
    assert waiting.take_out(lambda one: one is ahead[1]) == [ahead[1]] and len(waiting.take_out()) == 1


@pytest.mark.parametrize(("prefix", "asked"), [("a/", "a/camera"), ("", "camera")])
def test_a_camera_is_looked_for_under_the_prefix_of_its_robot_where_the_body_has_it(prefix: str, asked: str) -> None:
    graph, frames = PoseGraph(), list[str]()
    followers = Followers({"a": Follower("a", 5.0, lambda: None)})
    for sample in odometry(TRUE):
        followers["a"].follow_pose(replace(sample, child_frame_id=f"{prefix}base"), graph)
    waiting = ClosureQueue(followers, lambda samples, frame_id: frames.append(frame_id), most=2)
    closed = replace(of(closure(TRUE, 10, 90), "a", "a"), from_frame_id="a/camera", to_frame_id="a/camera")
    waiting.closures = [closed]
    assert [fate.reason for fate in waiting.tie(graph)] == [""] and set(frames) == {asked}
