# SPDX-License-Identifier: Apache-2.0
"""Which objects closed a pair, drawn over its two pictures: the matched ones in a colour each, tied by a line.

The pictures stand beside each other, each `WIDE` units wide, with a gap of `GAP`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Rejected
from objreg_ros.data.frames import UNNAMED
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import inverse, transform
from objreg_tools.offline.outlines import UNITS, outline
from objreg_tools.report.run.pairs import PairRow
from objreg_tools.report.run.rows import Glimpse

WIDE, GAP = 320, 8
NEAR_M = 0.25  # between the middles of an object in two keyframes: each sees another side of it
OTHER_NAME_M = 0.1  # so much farther counts one that has another label there
COLOURS = 6  # of matched objects, `.m0` to `.m5` of the style sheet; more begin again
RADIUS = 9.0  # of the circle around an object without an outline
LETTER, LINE = 8.0, 15.0  # a letter and a line of names


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """An object in a picture: its middle ``xyz (3,)`` m in the camera, and its outline (N, 2), N = 0 without one."""

    label: str
    xyz: Array
    outline: Array


class Drawn(NamedTuple):
    """SVG over two pictures, the height of the taller one, and the labels of what closed a pair and is in neither."""

    marks: str
    height: int
    lacking: tuple[str, ...] = ()


class Name(NamedTuple):
    """A name over an object: the middle of its lower edge."""

    text: str
    x: float
    y: float
    style: str

    @property
    def svg(self) -> str:
        """The name as SVG."""
        place = f'x="{self.x:.0f}" y="{self.y:.0f}" text-anchor="middle"'
        return f'<text class="mark {self.style}" {place}>{escape(self.text)}</text>'

    def covers(self, other: Name) -> bool:
        """Whether it lies over another one."""
        letters = LETTER * (len(self.text) + len(other.text)) / 2
        return abs(self.y - other.y) < LINE and abs(self.x - other.x) < letters


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """An object in both pictures; None where one keyframe has it from another of its frames."""

    label: str
    first: Seen | None
    second: Seen | None
    moved_m: float = 0.0


def seen_in(glimpse: Glimpse | None) -> list[Seen]:
    """The objects of a frame; none without a frame."""
    if glimpse is None:
        return []
    outlines = glimpse.outlines or ("",) * len(glimpse.objects)
    return [Seen(label, xyz, _corners(text)) for (label, xyz), text in zip(glimpse.objects, outlines, strict=True)]


def seen_object(label: str, xyz: Array, camera: Intrinsics) -> Seen:
    """An object in a picture by its points (M, 3) m."""
    return Seen(label, np.median(xyz, axis=0).astype(float), _corners(outline(xyz, camera)))


def matches_of(outcome: LoopClosure | Rejected, first: Sequence[Seen], second: Sequence[Seen]) -> list[Match]:
    """Which objects of both frames a pair laid on each other, those of a constraint by its labels; then what moved.

    None without a pose. An object that closed a constraint and that one of the frames does not show has one end only.
    """
    if outcome.T_from_to is None:
        return []
    wanted = _wanted(outcome)
    pairs = _nearest(outcome.T_from_to, first, second, wanted)
    found = [Match(label, first[i], second[j]) for label, i, j in pairs]
    if isinstance(outcome, Rejected):
        return found
    lacking = Counter(wanted) - Counter(match.label for match in found)
    left = [one for k, one in enumerate(first) if k not in {i for _, i, _ in pairs}]
    right = [one for k, one in enumerate(second) if k not in {j for _, _, j in pairs}]
    alone = [match for label in lacking for match in _alone(label, lacking[label], left, right)]
    return [*found, *alone, *_moved(outcome, left, right)]


def drawing(
    outcome: LoopClosure | Rejected,
    glimpses: tuple[Glimpse | None, Glimpse | None],
    cameras: tuple[Intrinsics, Intrinsics],
) -> Drawn:
    """What is drawn over the two pictures of a pair; nothing where nothing is known of their objects."""
    sides = seen_in(glimpses[0]), seen_in(glimpses[1])
    matches = matches_of(outcome, *sides)
    marks = marks_of(sides, matches, cameras, outcome.T_from_to)
    shown = {match.label for match in matches}
    lacking = () if isinstance(outcome, Rejected) else tuple(dict.fromkeys(outcome.labels))
    return Drawn(marks, max(map(height, cameras)), tuple(name for name in lacking if name not in shown))


def marks_of(
    sides: tuple[Sequence[Seen], Sequence[Seen]],
    matches: Sequence[Match],
    cameras: tuple[Intrinsics, Intrinsics],
    T_from_to: Array | None,
) -> str:
    """The objects of two pictures as SVG over both, the ``matches`` among them in a colour each.

    ``T_from_to (4, 4)`` says where a match is that one picture lacks; None where there is no such match.
    """
    matched = {id(end) for match in matches for end in (match.first, match.second)}
    shapes = [
        shape
        for side, (seen, camera) in enumerate(zip(sides, cameras, strict=True))
        for one in seen
        if id(one) not in matched
        for shape in _object(one, camera, side, "other", "" if one.label == UNNAMED else one.label)
    ]
    shapes += [shape for k, match in enumerate(matches) for shape in _match(match, k, T_from_to, cameras)]
    names = _apart_from_each_other([shape for shape in shapes if isinstance(shape, Name)])
    return "".join([*(shape for shape in shapes if isinstance(shape, str)), *(name.svg for name in names)])


def pair_drawing(pair: PairRow, first: DepthImage, second: DepthImage) -> Drawn:
    """The drawing of a pair over both of its pictures, and how high they are."""
    glimpses = (pair.run.glimpse_at(pair.outcome.from_ns), pair.run.glimpse_at(pair.outcome.to_ns))
    cameras = first.intrinsics, second.intrinsics
    return drawing(pair.outcome, glimpses, cameras)


def height(camera: Intrinsics) -> int:
    """The height of a picture that is `WIDE` wide."""
    return round(WIDE * camera.height / camera.width)


def _corners(text: str) -> Array:
    numbers = [corner.split(",") for corner in text.split()]
    return np.array(numbers, float).reshape(-1, 2) * (WIDE / UNITS)


def _wanted(outcome: LoopClosure | Rejected) -> list[str] | None:
    """The label of each object that closed a constraint, as often as it did; None where any may."""
    if isinstance(outcome, Rejected):
        return None
    named = [match.label.replace("_", " ") for match in outcome.objects]
    return named or list(outcome.labels)


def _nearest(
    T_from_to: Array, first: Sequence[Seen], second: Sequence[Seen], wanted: list[str] | None
) -> list[tuple[str, int, int]]:
    """(label, index in the first, index in the second) of what lies on each other by a pose, the nearest first."""
    costs = sorted(
        (_apart(T_from_to, one, other), i, j) for i, one in enumerate(first) for j, other in enumerate(second)
    )
    free, found = None if wanted is None else Counter(wanted), list[tuple[str, int, int]]()
    for cost, i, j in costs:
        if cost > NEAR_M or any(i == a or j == b for _, a, b in found):
            continue
        labels = (second[j].label, first[i].label)
        label = labels[0] if free is None else next((name for name in labels if free[name] > 0), None)
        if label is None:
            continue
        found.append((label, i, j))
        if free is not None:
            free[label] -= 1
    return found


def _apart(T_from_to: Array, one: Seen, other: Seen) -> float:
    """How far two objects are apart under a pose, m, and farther where their labels differ."""
    metres = float(np.linalg.norm(one.xyz - transform(T_from_to, other.xyz)))
    return metres + (0.0 if one.label == other.label else OTHER_NAME_M)


def _alone(label: str, count: int, left: list[Seen], right: list[Seen]) -> list[Match]:
    """Objects of a label that only one of the frames shows, at most so many."""
    ends = [Match(label, one, None) for one in left if one.label == label]
    ends += [Match(label, None, one) for one in right if one.label == label]
    return ends[:count]


def _moved(closure: LoopClosure, left: Sequence[Seen], right: Sequence[Seen]) -> list[Match]:
    """What stood elsewhere before, where both frames show it."""
    found = []
    for label, metres in closure.moved.items():
        before, now = (next((one for one in side if one.label == label), None) for side in (left, right))
        if before is not None and now is not None:
            found.append(Match(label, before, now, metres))
    return found


def _match(
    match: Match, number: int, T_from_to: Array | None, cameras: tuple[Intrinsics, Intrinsics]
) -> list[str | Name]:
    """Both ends of a match and the line between them."""
    style = f"m{number % COLOURS}" + (" moved" if match.moved_m else "")
    name = f"{match.label}, moved {match.moved_m:.2f} m" if match.moved_m else match.label
    ends, shapes = list[tuple[float, float]](), list[str | Name]()
    for side, one in enumerate((match.first, match.second)):
        shown = one or _by_pose(match, T_from_to)
        at = _middle(shown, cameras[side], side)
        if at is not None:
            ends.append(at)
            shapes += _object(shown, cameras[side], side, style if one else f"{style} guessed", name)
    if len(ends) == 2:
        (x0, y0), (x1, y1) = ends
        shapes.insert(0, f'<line class="mark {style}" x1="{x0:.0f}" y1="{y0:.0f}" x2="{x1:.0f}" y2="{y1:.0f}"/>')
    return shapes


def _by_pose(match: Match, T_from_to: Array | None) -> Seen:
    """Where the pose puts an object in the picture that does not show it."""
    one = match.first or match.second
    assert one is not None and T_from_to is not None
    T = inverse(T_from_to) if match.second is None else T_from_to
    return Seen(one.label, transform(T, one.xyz), np.zeros((0, 2)))


def _middle(one: Seen, camera: Intrinsics, side: int) -> tuple[float, float] | None:
    """The middle of an object over the pictures; None where it is outside of its own."""
    x, y, z = one.xyz
    if len(one.outline):
        u, v = one.outline.mean(axis=0)
    elif z > 0.0:
        u, v = (np.array([camera.fx * x, camera.fy * y]) / z + (camera.cx, camera.cy)) * (WIDE / camera.width)
    else:
        return None
    inside = 0.0 <= u <= WIDE and 0.0 <= v <= height(camera)
    return (float(u) + side * (WIDE + GAP), float(v)) if inside else None


def _object(one: Seen, camera: Intrinsics, side: int, style: str, name: str) -> list[str | Name]:
    """The outline of an object, or a circle at its middle, and its name; nothing outside of its picture."""
    at = _middle(one, camera, side)
    if at is None:
        return []
    corners = one.outline + np.array([side * (WIDE + GAP), 0.0])
    points = " ".join(f"{u:.0f},{v:.0f}" for u, v in corners)
    circle = f'<circle class="mark {style}" cx="{at[0]:.0f}" cy="{at[1]:.0f}" r="{RADIUS:.0f}"/>'
    shape = f'<polygon class="mark {style}" points="{points}"/>' if points else circle
    if not name:
        return [shape]
    top = float(corners[:, 1].min()) if points else at[1] - RADIUS
    return [shape, _name(name, at[0], top, side, style)]


def _name(text: str, x: float, top: float, side: int, style: str) -> Name:
    """The name over an object, or in it at the upper edge; it stays in its picture."""
    left, half = side * (WIDE + GAP), LETTER * len(text) / 2
    middle = min(max(x, left + half), left + WIDE - half)
    return Name(text, middle, top - 4 if top > LINE else top + LINE, style)


def _apart_from_each_other(names: Sequence[Name]) -> list[Name]:
    """The names, each moved up until it covers none placed before, matches first; at the upper edge they stay."""
    placed: list[Name] = []
    for name in sorted(names, key=lambda name: (name.style == "other", -name.y)):
        at = name
        while at.y > LINE and any(at.covers(other) for other in placed):
            at = at._replace(y=at.y - 1)
        placed.append(at)
    return placed
