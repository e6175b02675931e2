# SPDX-License-Identifier: Apache-2.0
"""A line that grows for hours, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator

Point = tuple[float, ...]

STEP_M = 0.02


class Thinned:
    """Points of a trajectory, each at least a step from the one before. Where they are too many, the step doubles."""

    def __init__(self, most: int) -> None:
        self._most, self._step_m, self._points = most, STEP_M, list[Point]()

    def add(self, point: Point) -> None:
        """Take a point in, unless it is within a step of the last."""
        if self._points and _apart(self._points[-1], point) < self._step_m:
            return
        self._points.append(point)
        if len(self._points) > self._most:
            self._step_m *= 2.0
            self._points = self._points[::2]

    def clear(self) -> None:
        """Begin anew."""
        self._points.clear()

    def __iter__(self) -> Iterator[Point]:
        return iter(self._points)

    def __len__(self) -> int:
        return len(self._points)


def _apart(a: Point, b: Point) -> float:
    return sum((x - y) ** 2 for x, y in zip(a, b, strict=True)) ** 0.5
