# SPDX-License-Identifier: Apache-2.0
"""The map that a user sees: keyframes out of odometry, tied together by constraints."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from objreg_ros.data import Array, LoopClosure, Odometry
from objreg_ros.geometry import inverse, rotation_angle
from objreg_ros.mapper.constraint import Constraint, between_keyframes, open3d_information
from objreg_ros.mapper.optimisation import Edge, optimise
from objreg_ros.mapper.params import MapperParams
from objreg_ros.mapper.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Summary:
    """What an optimisation came to: how many keyframes, and the closures that it kept and pruned."""

    keyframes: int
    kept: tuple[LoopClosure, ...]
    pruned: tuple[LoopClosure, ...]


class PoseGraph:
    """Keyframes, the odometry between them and the closures; `optimise` makes them agree.

    ``T_body_camera`` is where the camera of the closures sits on the body of the odometry.
    """

    def __init__(self, params: MapperParams | None = None, T_body_camera: Array | None = None) -> None:
        self.params = params or MapperParams()
        self.T_body_camera = np.eye(4) if T_body_camera is None else T_body_camera
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.odometry = Trajectory()
        self.keyframes = Trajectory()  # T_odom_body
        self._edges: list[Edge] = []
        self._closures: list[LoopClosure] = []
        self._closure_edges: list[Edge] = []
        self._poses: list[Array] = []  # T_map_body of the keyframes

    def add_odometry(self, odometry: Odometry) -> bool:
        """Take the newest pose; True if it became a keyframe. ValueError if time does not advance."""
        self.odometry.append(odometry.stamp_ns, odometry.T_odom_body)
        if not self._moved_on(odometry.T_odom_body):
            return False
        T_map_body = self.T_map_odom @ odometry.T_odom_body
        self.keyframes.append(odometry.stamp_ns, odometry.T_odom_body)
        self._poses.append(T_map_body)
        if len(self.keyframes) > 1:
            self._edges.append(self._odometry_edge())
        return True

    def add_closure(self, closure: LoopClosure) -> bool:
        """Tie the two keyframes nearest to the closure's moments; False if odometry does not cover both (yet)."""
        if not (self.odometry.covers(closure.from_ns) and self.odometry.covers(closure.to_ns)):
            return False
        k1, k2 = (self.keyframes.nearest(stamp) for stamp in (closure.from_ns, closure.to_ns))
        if k1 != k2:
            self._closures.append(closure)
            self._closure_edges.append(self._closure_edge(closure, k1, k2))
        return True

    def optimise(self) -> Summary:
        """Find the poses of the keyframes that agree best with odometry and with the closures that can be believed."""
        if not self._closure_edges:
            return Summary(len(self.keyframes), (), ())
        solution = optimise(self.keyframes.poses, self._edges + self._closure_edges, self.params.max_residual)
        self._poses = list(solution.poses)
        verdicts = list(zip(self._closures, solution.kept[len(self._edges) :], strict=True))
        kept = tuple(closure for closure, keep in verdicts if keep)
        pruned = tuple(closure for closure, keep in verdicts if not keep)
        return Summary(len(self.keyframes), kept, pruned)

    @property
    def T_map_odom(self) -> Array:
        """The correction of the newest keyframe; the identity before the first."""
        if not self._poses:
            return np.eye(4)
        return self._poses[-1] @ inverse(self.keyframes.poses[-1])

    def path(self) -> list[tuple[int, Array]]:
        """Stamp and ``T_map_body`` of every keyframe."""
        return list(zip(self.keyframes.stamps_ns, self._poses, strict=True))

    def corrected(self, stamps_ns: Iterable[int]) -> list[Array]:
        """``T_map_body`` at any moments that odometry covers; ValueError for one that it does not."""
        return [self._correction_at(stamp) @ self.odometry.at(stamp) for stamp in stamps_ns]

    def _correction_at(self, stamp_ns: int) -> Array:
        """``T_map_odom`` between keyframes goes over smoothly from the one to the other."""
        corrections = Trajectory()
        near = self.keyframes.nearest(stamp_ns)
        for k in range(max(near - 1, 0), min(near + 2, len(self.keyframes))):
            corrections.append(self.keyframes.stamps_ns[k], self._poses[k] @ inverse(self.keyframes.poses[k]))
        return corrections.at(min(max(stamp_ns, corrections.stamps_ns[0]), corrections.stamps_ns[-1]))

    def _moved_on(self, T_odom_body: Array) -> bool:
        if not self.keyframes.poses:
            return True
        distance, angle = _motion(inverse(self.keyframes.poses[-1]) @ T_odom_body)
        too_far = distance >= self.params.keyframe_translation
        return too_far or bool(angle >= np.radians(self.params.keyframe_rotation))

    def _odometry_edge(self) -> Edge:
        """The edge between the two newest keyframes."""
        target, source = len(self.keyframes) - 2, len(self.keyframes) - 1
        T_target_source = inverse(self.keyframes.poses[target]) @ self.keyframes.poses[source]
        way = sum(_motion(T_target_source))
        variance = way * np.repeat(
            [self.params.odometry_translation_error**2, np.radians(self.params.odometry_rotation_error) ** 2], 3
        )
        information = open3d_information(Constraint(T_target_source, np.diag(variance)))
        return Edge(target, source, T_target_source, information, uncertain=False)

    def _closure_edge(self, closure: LoopClosure, k1: int, k2: int) -> Edge:
        k1_ns, k2_ns = self.keyframes.stamps_ns[k1], self.keyframes.stamps_ns[k2]
        constraint = between_keyframes(closure, self.odometry, k1_ns, k2_ns, self.T_body_camera)
        return Edge(k1, k2, constraint.T_from_to, open3d_information(constraint), uncertain=True)


def _motion(T: Array) -> tuple[float, float]:
    """How far (m) and by how much (rad) a pose moves."""
    return float(np.linalg.norm(T[:3, 3])), rotation_angle(T[:3, :3])
