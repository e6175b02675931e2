# SPDX-License-Identifier: Apache-2.0
"""The nodes of RTAB-Map by their stamps, and a constraint moved to two of them."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from objreg_mapper.constraint import Constraint, between_keyframes
from objreg_mapper.params import MapperParams
from objreg_mapper.sparse import SparseTrajectory
from objreg_mapper.trajectory import Trajectory
from objreg_ros import limits
from objreg_ros.bridge.messages import motion_from_msg
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure

MOST_NODES = 1_000_000
SAME_NS = 1_000_000  # stamps that differ by less are one: a float64 holds a stamp to 240 ns
WANDERING = MapperParams().odometry_sigmas


class RtabmapNode(NamedTuple):
    """One node: ``T_odom_base (4, 4)`` as odometry gave it, which counts in its own map only."""

    stamp_ns: int
    number: int
    map_id: int
    T_odom_base: Array


class RtabmapNodes:
    """All nodes that ``mapData`` has sent. A number that comes with another stamp is of another database."""

    def __init__(self) -> None:
        self._nodes: dict[int, RtabmapNode] = {}
        self._order: list[tuple[int, int]] = []  # stamp, number

    def __len__(self) -> int:
        return len(self._nodes)

    def add_map_data(self, message: Any) -> bool:
        """Take the nodes of a MapData in; True if they are of another database, and the old ones are forgotten.

        Nodes without odometry and intermediate ones, which no link may name, are left out. ValueError for too many, and
        for one whose stamp or pose is none.
        """
        nodes = [_node(one) for one in message.nodes if one.id > 0 and one.weight >= 0 and _has_pose(one)]
        is_other = any(self._contradicts(node) for node in nodes)
        if is_other:
            self.clear()
        for node in nodes:
            self._add(node)
        return is_other

    def clear(self) -> None:
        """Know of none any more."""
        self._nodes.clear()
        self._order.clear()

    def _contradicts(self, node: RtabmapNode) -> bool:
        known = self._nodes.get(node.number)
        return known is not None and abs(known.stamp_ns - node.stamp_ns) > SAME_NS

    def _add(self, node: RtabmapNode) -> None:
        if node.number not in self._nodes:
            if len(self._nodes) >= MOST_NODES:
                raise ValueError(f"mapData: expected at most {MOST_NODES} nodes, got another one, {node.number}")
            insort(self._order, (node.stamp_ns, node.number))
        self._nodes[node.number] = node

    def nearest(self, stamp_ns: int) -> RtabmapNode:
        """The node nearest in time; ValueError without nodes."""
        if not self._order:
            raise ValueError("expected nodes of RTAB-Map, got none")
        return min(self._around(stamp_ns), key=lambda node: abs(node.stamp_ns - stamp_ns))

    def _around(self, stamp_ns: int) -> list[RtabmapNode]:
        """The last node before a stamp and the first one that is not; one of them at either end."""
        k = bisect_left(self._order, (stamp_ns, 0))
        return [self._nodes[number] for _, number in self._order[max(k - 1, 0) : k + 1]]

    def camera_path(self, stamps_ns: Iterable[int]) -> Trajectory | None:
        """Odometry by the nodes around some stamps, straight between two; None where these do not enclose one."""
        poses: dict[int, Array] = {}
        for stamp_ns in stamps_ns:
            nearest, around = self.nearest(stamp_ns), self._around(stamp_ns)
            is_there = abs(nearest.stamp_ns - stamp_ns) <= SAME_NS
            if not is_there and (len(around) < 2 or around[0].map_id != around[1].map_id):
                return None
            poses |= {node.stamp_ns: node.T_odom_base for node in around}
            if is_there:
                poses[stamp_ns] = nearest.T_odom_base
        trajectory = Trajectory()
        for stamp_ns in sorted(poses):
            trajectory.append(stamp_ns, poses[stamp_ns])
        return trajectory

    def tied(
        self, closure: LoopClosure, odometry: SparseTrajectory, T_base_camera: Array
    ) -> tuple[int, int, Constraint] | None:
        """The nodes nearest to the closure's stamps, and the constraint between their base frames.

        By ``odometry`` where it covers the paths from the stamps to the nodes and was not silent on them, else by the
        nodes around the stamps. None where neither does (yet).
        """
        k1, k2 = self.nearest(closure.from_ns), self.nearest(closure.to_ns)
        stamps_ns = (closure.from_ns, closure.to_ns)
        spans = zip(stamps_ns, (k1.stamp_ns, k2.stamp_ns), strict=True)
        covered = all(_is_known(odometry, *sorted(ends)) for ends in spans)
        path: Trajectory | None = odometry if covered else self.camera_path(stamps_ns)
        if path is None:
            return None
        between = between_keyframes(closure, (path, path), (k1.stamp_ns, k2.stamp_ns), T_base_camera, WANDERING)
        return k1.number, k2.number, between


def _is_known(odometry: SparseTrajectory, first_ns: int, last_ns: int) -> bool:
    """Whether odometry leads from one stamp to another: in a silence between them it may have begun anew."""
    return odometry.covers(first_ns) and odometry.covers(last_ns) and odometry.silent_s(first_ns, last_ns) == 0.0


def _has_pose(message: Any) -> bool:
    turn = message.pose.orientation
    return any((turn.x, turn.y, turn.z, turn.w))


def _node(message: Any) -> RtabmapNode:
    seconds = float(message.stamp)
    if not (np.isfinite(seconds) and 0.0 <= seconds <= 1e-9 * limits.MOST_STAMP_NS):
        raise ValueError(f"mapData: expected a stamp of seconds, got {seconds} of node {message.id}")
    T = motion_from_msg.motion(message)
    if not np.abs(T[:3, 3]).max() <= limits.MOST_DISTANCE:
        raise ValueError(f"mapData: expected a pose within {limits.MOST_DISTANCE:g} m, got one at {T[:3, 3].tolist()}")
    return RtabmapNode(round(1e9 * seconds), int(message.id), int(message.map_id), T)
