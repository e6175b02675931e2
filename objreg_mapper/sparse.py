# SPDX-License-Identifier: Apache-2.0
"""Poses over time without those that interpolation gives back: a robot at rest would fill the memory with one pose."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from objreg_mapper.trajectory import Trajectory
from objreg_ros.data.checked import Array
from objreg_ros.geometry import vector_from_rotation

TOLERANCE_M, TOLERANCE_DEG = 1e-3, 0.05
EACH_AXIS = np.repeat([TOLERANCE_M, np.radians(TOLERANCE_DEG)], 3) / np.sqrt(3)  # so that three of them keep within it
SECOND_NS = 1_000_000_000
GAP_NS = 1_000_000_000  # while nothing comes for longer, and for `MISSED` times as long as usual,
MISSED = 5.0  # nobody knows what happens;
LONGEST_NS = 60_000_000_000  # nor for longer than this, whatever is usual: the first pose may have no time at all
NEWEST = 0.1  # the weight of the newest time between two poses in what is usual


class SparseTrajectory(Trajectory):
    """A `Trajectory` whose `at` is within 1 mm and 0.05° of every pose that was appended, of however few it keeps.

    The first, the newest and every pinned pose are kept as they are. A pose between the last one that stays and the
    newest is left out while the straight line between the two passes it and all that were left out before near enough:
    each of them bounds the velocity of that line, so what was left out need not be known any more (Bristol, "Swinging
    Door Trending", 1990). Turns are compared as rotation vectors: these are never nearer than the rotations are.

    Times within a gap of the poses (`GAP_NS`) are not covered.
    """

    def __init__(self) -> None:
        super().__init__()
        self._gaps: list[tuple[int, int]] = []
        self._usual_ns = np.inf  # the time between two poses
        self._least, self._most = _nothing()

    @classmethod
    def of(cls, stamps_ns: list[int], poses: list[Array], gaps: list[tuple[int, int]]) -> SparseTrajectory:
        """One that is over: what another of these kept."""
        trajectory = cls()
        for stamp_ns, T in zip(stamps_ns, poses, strict=True):
            Trajectory.append(trajectory, stamp_ns, T)
        trajectory._gaps = gaps
        return trajectory

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """The silences, from the pose before to the one after, ns."""
        return list(self._gaps)

    def append(self, stamp_ns: int, T_world_body: Array) -> None:
        """Add the newest pose; the one before it goes if it can. ValueError if time does not advance."""
        last_ns = self.stamps_ns[-1] if self.stamps_ns else stamp_ns
        super().append(stamp_ns, T_world_body)
        if len(self) > 1 and self._is_gap(stamp_ns - last_ns):
            self._gaps.append((last_ns, stamp_ns))
            self.pin()  # both ends are to stay
            return
        if np.all(self._least <= self._most):  # the newest but one is not to stay yet
            velocity, slack = self._velocity_from(-3)
            if np.all((self._least <= velocity) & (velocity <= self._most)):
                del self.stamps_ns[-2], self.poses[-2]
                self._least = np.maximum(self._least, velocity - slack)
                self._most = np.minimum(self._most, velocity + slack)
                return
        if len(self) > 1:
            velocity, slack = self._velocity_from(-2)
            self._least, self._most = velocity - slack, velocity + slack

    def covers(self, stamp_ns: int) -> bool:
        """Whether the time lies between the first and the last pose, and in no gap."""
        return super().covers(stamp_ns) and not self.in_gap(stamp_ns)

    def in_gap(self, stamp_ns: int) -> bool:
        """Whether nothing came around the time."""
        k = bisect_left(self._gaps, stamp_ns, key=lambda gap: gap[1])
        return k < len(self._gaps) and self._gaps[k][0] < stamp_ns < self._gaps[k][1]

    def silent_s(self, first_ns: int, last_ns: int) -> float:
        """For how many seconds between two stamps nothing came."""
        return sum(max(0, min(end, last_ns) - max(start, first_ns)) for start, end in self._gaps) / SECOND_NS

    def pin(self) -> None:
        """The newest pose is to stay, as it is."""
        self._least, self._most = _nothing()

    def _is_gap(self, waited_ns: int) -> bool:
        """Whether nothing came for too long. A gap adds to the usual time too, else rarer poses never do."""
        longest_ns = min(max(GAP_NS, MISSED * self._usual_ns), LONGEST_NS)
        is_gap, counted_ns = waited_ns > longest_ns, min(waited_ns, longest_ns)
        if np.isfinite(self._usual_ns):
            self._usual_ns += NEWEST * (counted_ns - self._usual_ns)
        elif not is_gap:
            self._usual_ns = float(counted_ns)
        return is_gap

    def _velocity_from(self, before: int) -> tuple[Array, Array]:
        """The velocity (6,) from a kept pose to the newest, m/s in the world and rad/s in the body, and its slack."""
        T_start, T_end = self.poses[before], self.poses[-1]
        seconds = (self.stamps_ns[-1] - self.stamps_ns[before]) / SECOND_NS
        turn = vector_from_rotation(T_start[:3, :3].T @ T_end[:3, :3])
        return np.concatenate([T_end[:3, 3] - T_start[:3, 3], turn]) / seconds, EACH_AXIS / seconds


def _nothing() -> tuple[Array, Array]:
    """Bounds of a velocity that none is within."""
    return np.full(6, np.inf), np.full(6, -np.inf)
