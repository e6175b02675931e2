# SPDX-License-Identifier: Apache-2.0
"""One run of one robot's odometry: the poses, and those of them that are keyframes of the map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from objreg_mapper.constraint import Constraint, unseen, wandering
from objreg_mapper.params import MapperParams
from objreg_mapper.sparse import SparseTrajectory
from objreg_mapper.trajectory import Trajectory
from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import inverse, is_rigid, rotation_angle

LOST_S = 600.0  # a silence after which the body may be anywhere, so that a longer one adds no doubt


class Session:
    """Its ``odometry`` gives back what was added to within 1 mm and 0.05°, and the poses of ``keyframes`` exactly.

    ``robot`` is whose odometry it is, empty for the only one there is. ``names`` are the sessions that closures give
    its keyframes. ``is_over``: no odometry comes any more. Everything grows at the end alone, so a length says what
    was there at one time.
    """

    def __init__(self, robot: str = "") -> None:
        self.robot, self.is_over = robot, False
        self.names = set[int]()
        self.odometry, self.keyframes = SparseTrajectory(), Trajectory()
        self.variances: list[tuple[float, float]] = []  # of each step between keyframes: m^2 and rad^2 in every axis
        self._path_m = [0.0]

    def add_pose(self, odometry: Odometry, params: MapperParams) -> bool:
        """Take the next pose; whether it became a keyframe. ValueError if time does not advance."""
        self.odometry.append(odometry.stamp_ns, odometry.T_odom_body)
        if not self._moved_on(odometry.T_odom_body, params):
            return False
        self.odometry.pin()
        self.keyframes.append(odometry.stamp_ns, odometry.T_odom_body)
        if len(self.keyframes) > 1:
            self._step(params)
        return True

    ARRAYS = ("stamps_ns", "poses", "keyframes", "gaps", "variances", "way")

    def arrays(self) -> dict[str, Array]:
        """All of it: poses with stamps, which of them are keyframes, silences, errors and lengths of the steps."""
        return {
            "stamps_ns": np.array(self.odometry.stamps_ns, np.int64),
            "poses": stacked(self.odometry.poses),
            "keyframes": np.array(self.keyframes.stamps_ns, np.int64),
            "gaps": np.array(self.odometry.gaps, np.int64).reshape(-1, 2),
            "variances": np.array(self.variances).reshape(-1, 2),
            "way": np.array(self._path_m),
        }

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, Array]) -> Session:
        """The session of such arrays, which is over. ValueError where they do not go together."""
        session = cls()
        stamps, poses, keyframes = arrays["stamps_ns"], arrays["poses"], arrays["keyframes"]
        count, steps = len(keyframes), max(len(keyframes) - 1, 0)
        variances, way, gaps = arrays["variances"], arrays["way"], arrays["gaps"]
        shapes = [len(stamps), variances.shape, way.shape]
        if gaps.shape != (len(gaps), 2) or any(part.dtype != np.int64 for part in (stamps, keyframes, gaps)):
            raise ValueError(f"session: expected stamps and gaps in whole nanoseconds, got {gaps.shape} {stamps.dtype}")
        if shapes != [len(poses), (steps, 2), (max(count, 1),)] or not np.isin(keyframes, stamps).all():
            raise ValueError(f"session: expected arrays that go together, got {shapes} of {count} keyframes")
        known = np.concatenate([stamps, gaps.ravel()])
        if len(known) and not limits.LEAST_STAMP_NS <= known.min() <= known.max() <= limits.MOST_STAMP_NS:
            raise ValueError(f"session: expected stamps that ROS has, got {known.min()} to {known.max()} ns")
        spread = (variances > 0) & (variances < np.inf)
        if not (np.isfinite(poses).all() and all(is_rigid(T) for T in poses) and spread.all()):
            raise ValueError("session: expected rigid poses and positive variances, got others")
        if not (np.isfinite(way).all() and (np.diff(way) >= 0.0).all()):
            raise ValueError("session: expected a path length that grows, got one that does not")
        session.odometry = SparseTrajectory.of(stamps.tolist(), list(poses), [tuple(gap) for gap in gaps.tolist()])
        for stamp in keyframes.tolist():
            session.keyframes.append(stamp, session.odometry.at(stamp))
        session.variances, session._path_m = [tuple(row) for row in variances.tolist()], way.tolist()
        session.is_over = True
        return session

    def covers(self, stamp_ns: int) -> bool:
        """Whether its odometry says where the body was at a stamp."""
        return self.odometry.covers(stamp_ns)

    def is_ahead(self, stamp_ns: int) -> bool:
        """Whether its odometry, which goes on, has yet to come to a stamp after it began."""
        known = self.odometry.stamps_ns
        return not known or (known[0] <= stamp_ns and known[-1] < stamp_ns)

    def step(self, k: int) -> Constraint:
        """What odometry says from the keyframe before to this one."""
        T_1_2 = inverse(self.keyframes.poses[k - 1]) @ self.keyframes.poses[k]
        return Constraint(T_1_2, np.diag(np.repeat(self.variances[k - 1], 3)))

    def path_m(self, k1: int, k2: int) -> float:
        """How far odometry went between two keyframes."""
        return abs(self._path_m[k2] - self._path_m[k1])

    def silent_s(self, k1: int, k2: int) -> float:
        """For how long odometry said nothing between two keyframes."""
        return self.odometry.silent_s(*sorted((self.keyframes.stamps_ns[k1], self.keyframes.stamps_ns[k2])))

    def _moved_on(self, T_odom_body: Array, params: MapperParams) -> bool:
        if not self.keyframes.poses:
            return True
        T_last_body = inverse(self.keyframes.poses[-1]) @ T_odom_body
        turned = np.degrees(rotation_angle(T_last_body[:3, :3])) >= params.keyframe_rotation
        return bool(turned or np.linalg.norm(T_last_body[:3, 3]) >= params.keyframe_translation)

    def _step(self, params: MapperParams) -> None:
        """What odometry says between the two newest keyframes: next to nothing where it was silent meanwhile."""
        first, second = self.keyframes.poses[-2:]
        self._path_m.append(self._path_m[-1] + float(np.linalg.norm(second[:3, 3] - first[:3, 3])))
        silent_s = min(self.silent_s(len(self.keyframes) - 2, len(self.keyframes) - 1), LOST_S)
        C = wandering(inverse(first) @ second, params.odometry_sigmas) + unseen(silent_s, params.max_speed)
        self.variances.append((float(C[0, 0]), float(C[3, 3])))


def stacked(poses: Sequence[Array]) -> Array:
    """(n, 4, 4), of none too."""
    return np.array(poses).reshape(-1, 4, 4)
