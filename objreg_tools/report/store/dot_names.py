# SPDX-License-Identifier: Apache-2.0
"""Names beside the dots of a drawing, none of which lies upon another or upon a dot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

LETTER, LINE = 8.0, 13.0  # px that a letter is wide at most, and a line high
GAP = 3.0  # px between a dot and its name


class Dot(NamedTuple):
    """A dot in pixels, and its name; ``weight`` says who is named first."""

    x: float
    y: float
    radius: float
    name: str
    weight: float


class Box(NamedTuple):
    """A rectangle in pixels, y downward."""

    left: float
    top: float
    right: float
    bottom: float

    def meets(self, other: Box) -> bool:
        """Whether the two share a place."""
        beside = self.right <= other.left or other.right <= self.left
        return not (beside or self.bottom <= other.top or other.bottom <= self.top)


def placed(dots: Sequence[Dot], width: float, height: float) -> list[Box | None]:
    """The box of the name of each dot within the drawing, in their order; None where it has no free place."""
    taken = [Box(x - r, y - r, x + r, y + r) for x, y, r, _, _ in dots]
    boxes: list[Box | None] = [None] * len(dots)
    for k in sorted(range(len(dots)), key=lambda k: -dots[k].weight):
        free = next((box for box in _around(dots[k]) if _fits(box, taken, width, height)), None)
        if free is not None:
            boxes[k] = free
            taken.append(free)
    return boxes


def _around(dot: Dot) -> list[Box]:
    """To the right, to the left, above and below, and at the corners."""
    wide, off = LETTER * len(dot.name), dot.radius + GAP
    right, left, middle = dot.x + off, dot.x - off - wide, dot.x - wide / 2
    level, above, below = dot.y - LINE / 2, dot.y - off - LINE, dot.y + off
    corners = [(right, above), (right, below), (left, above), (left, below)]
    places = [(right, level), (left, level), (middle, above), (middle, below), *corners]
    return [Box(x, y, x + wide, y + LINE) for x, y in places]


def _fits(box: Box, taken: Sequence[Box], width: float, height: float) -> bool:
    inside = box.left >= 0 and box.top >= 0 and box.right <= width and box.bottom <= height
    return inside and not any(box.meets(other) for other in taken)
