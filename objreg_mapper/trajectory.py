# SPDX-License-Identifier: Apache-2.0
"""Poses over time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator

from objreg_ros.data.checked import Array
from objreg_ros.geometry import interpolate


class Trajectory:
    """Poses ``T_world_body`` with increasing stamps."""

    def __init__(self) -> None:
        self.stamps_ns: list[int] = []
        self.poses: list[Array] = []

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __iter__(self) -> Iterator[tuple[int, Array]]:
        return iter(zip(self.stamps_ns, self.poses, strict=True))

    def append(self, stamp_ns: int, T_world_body: Array) -> None:
        """Add the newest pose; ValueError if time does not advance."""
        if self.stamps_ns and stamp_ns <= self.stamps_ns[-1]:
            raise ValueError(f"expected a stamp after {self.stamps_ns[-1]} ns, got {stamp_ns} ns")
        self.stamps_ns.append(stamp_ns)
        self.poses.append(T_world_body)

    def covers(self, stamp_ns: int) -> bool:
        """Whether the time lies between the first and the last pose."""
        return bool(self.stamps_ns) and self.stamps_ns[0] <= stamp_ns <= self.stamps_ns[-1]

    def at(self, stamp_ns: int) -> Array:
        """The pose at a covered time, interpolated; ValueError for one that is not covered."""
        if not self.covers(stamp_ns):
            span = f"{self.stamps_ns[0]} to {self.stamps_ns[-1]} ns" if self.stamps_ns else "nothing"
            raise ValueError(f"expected a stamp within {span}, got {stamp_ns} ns")
        before, after, fraction = self._bracket(stamp_ns)
        return interpolate(self.poses[before], self.poses[after], fraction)

    def nearest(self, stamp_ns: int) -> int:
        """The index of the pose nearest in time; ValueError without poses."""
        if not self.stamps_ns:
            raise ValueError("expected at least one pose, got none")
        after = min(bisect_right(self.stamps_ns, stamp_ns), len(self) - 1)
        before = max(after - 1, 0)
        later = abs(self.stamps_ns[after] - stamp_ns) < abs(stamp_ns - self.stamps_ns[before])
        return after if later else before

    def _bracket(self, stamp_ns: int) -> tuple[int, int, float]:
        after = min(bisect_right(self.stamps_ns, stamp_ns), len(self) - 1)
        before = max(after - 1, 0)
        span = self.stamps_ns[after] - self.stamps_ns[before]
        return before, after, (stamp_ns - self.stamps_ns[before]) / span if span else 0.0
