# SPDX-License-Identifier: Apache-2.0
"""The odometry of one robot before it enters the graph."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from objreg_mapper.pose_graph import PoseGraph
from objreg_mapper.restart import Admitted, Restart
from objreg_ros.data.frames import JUMP_NS, Odometry


class Follower:
    """Follows what is admitted; ``on_leap`` is called for every pose that leapt and came back.

    ``robot`` is its name in the graph. ``has_news``: a keyframe or a solution came that is not published yet.
    """

    def __init__(self, robot: str, max_speed: float, on_leap: Callable[[], None]) -> None:
        self.robot, self._on_leap = robot, on_leap
        self.newest: Odometry | None = None
        self.has_news = False
        self.count = self.passed_over_count = 0
        self._ended_ns = 0  # the last stamp of the run of the clock before this one
        self.believe_next(max_speed)

    def believe_next(self, max_speed: float) -> None:
        """Whatever comes next is believed."""
        self._restart = Restart(max_speed, self._pass_over)

    def admit(self, odometry: Odometry) -> Admitted:
        """What may be followed now that a pose came."""
        return self._restart.admit(odometry)

    def _pass_over(self, odometry: Odometry) -> None:
        """Count a pose that was wrong; one that came again or late did not leap."""
        self.passed_over_count += 1
        if self.newest is not None and odometry.stamp_ns > self.newest.stamp_ns:
            self._on_leap()

    def follow_pose(self, odometry: Odometry, graph: PoseGraph) -> None:
        """Take a pose that was admitted into the graph."""
        self.count, self.newest = self.count + 1, odometry
        self.has_news = graph.add_odometry(odometry, self.robot) or self.has_news

    def jump_back(self, stamp_ns: int) -> float:
        """Its time is another from now on; how many seconds it went back."""
        self._ended_ns = 0 if self.newest is None else self.newest.stamp_ns
        return 1e-9 * (self._ended_ns - stamp_ns)

    def is_confusable(self, graph: PoseGraph) -> bool:
        """Whether closures of a run by the same clock would be of both runs, in a graph that no other robot is in."""
        session = graph.sessions.newest(self.robot)
        is_alone = all(one.robot == self.robot for one in graph.sessions)
        return is_alone and session is not None and not graph.sessions[session].names

    def is_of_old_run(self, stamp_ns: int) -> bool:
        """Whether what ends at a stamp was found before time jumped back: the registrar searches for a while.

        It concerns the past, so what is of this run does not end long after the newest odometry.
        """
        return self.newest is not None and self.newest.stamp_ns + JUMP_NS < stamp_ns <= self._ended_ns


class Followers(dict[str, Follower]):
    """Those of all robots, by name."""

    def meant(self, robot: str) -> list[Follower]:
        """The one of this name; all of them where there is none."""
        return [self[robot]] if robot in self else list(self.values())

    def share_frame(self, follower: Follower) -> bool:
        """Whether another robot's odometry is in a frame of the same name, of which TF can give but one place."""
        frames = [one.newest.frame_id for one in self.values() if one is not follower and one.newest is not None]
        return follower.newest is not None and follower.newest.frame_id in frames

    def counts(self, graph: PoseGraph) -> dict[str, dict[str, Any]]:
        """What is known of each robot, by its name: fields of `MapperDiagnostics`."""
        return {
            "odometry": {robot: follower.count for robot, follower in self.items()},
            "passed_over": {robot: follower.passed_over_count for robot, follower in self.items()},
            "placed": {robot: graph.T_map_odom_of(robot) is not None for robot in self},
            "keyframes": {robot: len(graph.keyframes_of(robot)) for robot in self},
        }
