# SPDX-License-Identifier: Apache-2.0
"""A scheme for each reason of a refusal, and two for the drops: plain SVG, the room seen from above.

Green is the earlier view and magenta the new one, as in the overlays of a report. Red is what is wrong. Lengths are in
pixels, angles in degrees clockwise from the right.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import cos, radians, sin

WIDTH, HEIGHT = 400, 150
EARLIER, NEW, THING, WRONG, QUIET = "#2e7d32", "#ad1457", "#3f51b5", "#d32f2f", "#607d8b"
REACH, HALF_VIEW_DEG = 95.0, 24.0  # how far a camera sees here, and how wide
LEFT, RIGHT = 20, 380  # of an axis of time


def picture(*parts: str, height: int = HEIGHT) -> str:
    """A whole SVG file of such parts on a light ground, which is legible in dark pages too."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}"'
    ground = f'<rect width="{WIDTH}" height="{height}" rx="8" fill="#fafafa"/>'
    return f'{head} font-family="sans-serif" font-size="11">{ground}{"".join(parts)}</svg>\n'


def words(x: float, y: float, text: str, colour: str = "#333", anchor: str = "middle") -> str:
    return f'<text x="{x:g}" y="{y:g}" fill="{colour}" text-anchor="{anchor}">{escape(text)}</text>'


def line(points: Sequence[tuple[float, float]], colour: str, width: float = 2, dashed: bool = False) -> str:
    dashes = ' stroke-dasharray="4 4"' if dashed else ""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashes}/>'


def arrow(x: float, y: float, to_x: float, to_y: float, colour: str, dashed: bool = False) -> str:
    """A line with a head at its end."""
    length = max(1.0, ((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5)
    u, v = (to_x - x) / length, (to_y - y) / length
    barbs = [(to_x - 7 * u + 4 * s * v, to_y - 7 * v - 4 * s * u) for s in (1, -1)]
    return line([(x, y), (to_x, to_y)], colour, 2, dashed) + line([barbs[0], (to_x, to_y), barbs[1]], colour)


def camera(x: float, y: float, turn_deg: float, colour: str, reach: float = REACH) -> str:
    """A camera and the wedge that it sees."""
    rim = [turn_deg - HALF_VIEW_DEG, turn_deg, turn_deg + HALF_VIEW_DEG]
    ends = " ".join(f"{x + reach * cos(radians(a)):.1f},{y + reach * sin(radians(a)):.1f}" for a in rim)
    wedge = f'<polygon points="{x:g},{y:g} {ends}" fill="{colour}" opacity="0.13"/>'
    return wedge + f'<circle cx="{x:g}" cy="{y:g}" r="5" fill="{colour}"/>'


def thing(x: float, y: float, colour: str = THING, turn_deg: float = 0, ghost: bool = False, size: float = 18) -> str:
    """An object; a ghost is where a pose puts it."""
    style = f'fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="4 3"' if ghost else f'fill="{colour}"'
    turn = f' transform="rotate({turn_deg:g} {x:g} {y:g})"'
    return f'<rect x="{x - size / 2:g}" y="{y - size / 2:g}" width="{size:g}" height="{size:g}" rx="2" {style}{turn}/>'


def wall(x: float, y: float, to_x: float, to_y: float, colour: str = QUIET) -> str:
    return line([(x, y), (to_x, to_y)], colour, 5)


def time_axis(y: float, text: str = "time") -> str:
    return arrow(LEFT, y, RIGHT, y, QUIET) + words(RIGHT, y + 15, text, QUIET, "end")


def tie(x: float, to_x: float, y: float, colour: str, dashed: bool = False) -> str:
    """A closure between two moments of an axis of time."""
    steps = [(x + (to_x - x) * k / 20, y - 50 * sin(radians(9 * k))) for k in range(21)]
    return line(steps, colour, 2, dashed)


def boxes(names: Iterable[str], y: float, colour: str) -> str:
    """Names in boxes in a row from the left, with arrows between."""
    names, parts = list(names), list[str]()
    step = (RIGHT - LEFT + 20) / len(names)
    for k, name in enumerate(names):
        x, width = LEFT + k * step, step - 20
        parts.append(f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="26" rx="4" fill="#fff" stroke="{colour}"/>')
        parts.append(words(x + width / 2, y + 17, name))
        if k:
            parts.append(arrow(x - 19, y + 13, x - 2, y + 13, colour))
    return "".join(parts)


def falls(x: float, y: float, reasons: Sequence[str]) -> str:
    """The reasons by which a frame ends below a box."""
    lines = [words(x, y + 40 + 15 * k, reason, WRONG) for k, reason in enumerate(reasons)]
    return arrow(x, y, x, y + 24, WRONG, dashed=True) + "".join(lines)


TWO = camera(60, 75, 0, EARLIER) + camera(340, 75, 180, NEW)

SCHEMES = {
    "no_candidate": picture(
        camera(60, 75, 0, EARLIER), thing(120, 60), thing(130, 90, QUIET), words(122, 135, "stored: chair, cup"),
        camera(250, 75, 0, NEW), thing(325, 75, "#00897b"), words(305, 135, "seen now: a monitor"),
    ),
    "no_hypothesis": picture(
        camera(50, 75, 0, EARLIER), thing(110, 75), camera(350, 75, 180, NEW), thing(290, 75, turn_deg=30),
        words(200, 82, "?", WRONG), words(200, 135, "no pose lays the one upon the other"),
    ),
    "not_converged": picture(
        wall(60, 30, 170, 30, EARLIER), wall(60, 30, 60, 110, EARLIER),
        wall(230, 60, 340, 75, NEW), wall(340, 75, 328, 120, NEW),
        line([(165, 32), (232, 58)], WRONG, 1, True), words(200, 140, "too few points have a partner near them"),
    ),
    "low_overlap": picture(
        camera(70, 110, -60, EARLIER, 110), camera(330, 110, -120, NEW, 110),
        thing(120, 35), thing(282, 35, "#00897b"), words(200, 140, "the two views share too little"),
    ),
    "free_space_violated": picture(
        camera(50, 70, 0, EARLIER, 250), wall(300, 20, 300, 120), thing(170, 70, WRONG, ghost=True, size=24),
        words(170, 45, "it would float here", WRONG), words(200, 140, "the earlier camera saw the wall through it"),
    ),
    "texture_disagrees": picture(
        *(wall(60, y, 160, y, EARLIER) for y in (40, 60, 80)), *(wall(x, 30, x, 90, NEW) for x in (250, 275, 300, 325)),
        words(110, 115, "what was seen"), words(288, 115, "what is seen there now"),
        words(200, 140, "one shape, two prints"),
    ),
    "few_objects_matched": picture(
        TWO, thing(170, 45), thing(180, 100), thing(222, 62, WRONG, ghost=True), thing(232, 88, WRONG, ghost=True),
        words(200, 140, "no object lies upon itself"),
    ),
    "proposers_disagree": picture(
        thing(200, 70, size=30), camera(80, 70, 0, EARLIER), camera(320, 40, 165, NEW), camera(320, 105, 195, NEW),
        words(200, 140, "two poses fit as well: one of them is wrong"),
    ),
    "gravity_not_kept": picture(
        arrow(90, 30, 90, 90, EARLIER), words(90, 110, "down, then"), arrow(280, 30, 310, 84, NEW),
        words(300, 110, "down, by the pose"), words(200, 140, "the room would tilt"),
    ),
    "implausible_motion": picture(
        camera(40, 60, 0, EARLIER, 60), camera(360, 60, 180, NEW, 60), arrow(110, 60, 290, 60, WRONG),
        words(200, 50, "farther than max_translation", WRONG), words(200, 140, "two views of one place are nearer"),
    ),
    "odometry_disagrees": picture(
        line([(40, 110), (110, 60), (190, 50), (270, 60)], QUIET, 2), camera(40, 110, -30, EARLIER, 50),
        '<ellipse cx="270" cy="60" rx="42" ry="28" fill="#607d8b" opacity="0.2"/>', words(270, 25, "odometry expects"),
        camera(360, 110, 200, WRONG, 50), words(200, 140, "the pose is beyond what odometry may be off"),
    ),
    "slides_along_a_plane": picture(
        wall(40, 30, 360, 30), camera(150, 105, -90, EARLIER, 70), camera(240, 105, -90, NEW, 70),
        arrow(260, 120, 320, 120, WRONG), arrow(220, 120, 170, 120, WRONG),
        words(200, 142, "anywhere along the wall fits as well"),
    ),
    "objects_moved": picture(
        TWO, thing(175, 40), *(thing(170, y, QUIET, ghost=True) + arrow(182, y, 224, y + 12, WRONG) for y in (70, 100)),
        thing(236, 84, NEW), thing(236, 114, NEW), words(200, 142, "one stayed, two went"),
    ),
    "redundant": picture(
        time_axis(110), tie(60, 300, 110, EARLIER), tie(68, 310, 110, QUIET, True),
        words(185, 40, "accepted: the one beside it says the same"),
    ),
    "over_budget": picture(
        time_axis(110), *(f'<rect x="{x}" y="80" width="60" height="22" fill="{EARLIER}"/>' for x in (40, 106, 172)),
        f'<rect x="250" y="80" width="60" height="22" fill="none" stroke="{WRONG}"/>', wall(240, 60, 240, 112, WRONG),
        words(135, 72, "places that were tried"), words(318, 72, "not begun any more", WRONG),
    ),
    "unreadable": picture(
        *(f'<rect x="100" y="{y}" width="200" height="18" fill="#fff" stroke="{QUIET}"/>' for y in (20, 42, 64, 86)),
        line([(100, 64), (300, 82)], WRONG), line([(100, 82), (300, 64)], WRONG),
        words(200, 130, "a keyframe of the store is damaged, the others are not"),
    ),
    "clock_began_anew": picture(
        time_axis(60, ""), time_axis(110), words(LEFT, 50, "first run", EARLIER, "start"),
        words(LEFT, 100, "second run", NEW, "start"), line([(100, 60), (300, 60)], EARLIER, 6),
        line([(100, 110), (220, 110)], NEW, 6), line([(160, 60), (160, 110)], WRONG, 1, True),
        words(200, 140, "one stamp, two moments"),
    ),
    "camera_implausible": picture(
        line([(60, 110), (200, 30), (340, 110)], EARLIER), line([(60, 110), (200, 70), (340, 110)], WRONG),
        words(200, 24, "how the picture moves", EARLIER), words(200, 90, "what camera_info says", WRONG),
        words(200, 140, "no closure is made with a camera that is not what it says"),
    ),
    "places_alike": picture(
        line([(60, 40), (160, 40)], EARLIER, 6), line([(240, 40), (340, 40)], EARLIER, 6),
        line([(150, 110), (250, 110)], NEW, 6), arrow(180, 104, 120, 48, WRONG), arrow(220, 104, 280, 48, WRONG),
        words(200, 140, "both places fit: neither is published"),
    ),
    "neighbours_disagree": picture(
        line([(60, 40), (160, 35), (260, 40), (340, 35)], EARLIER),
        line([(60, 110), (160, 105), (260, 110), (340, 105)], NEW),
        *(arrow(x, 104, x, 44, EARLIER) for x in (80, 140, 320)), arrow(240, 106, 120, 42, WRONG),
        words(200, 140, "the keyframes around it support another pose"),
    ),
    "vetoed": picture(
        line([(60, 40), (160, 35), (260, 40), (340, 35)], EARLIER),
        line([(60, 110), (160, 105), (260, 110), (340, 105)], NEW),
        arrow(160, 104, 260, 44, WRONG), arrow(180, 106, 280, 42, WRONG),
        words(200, 140, "a person withdrew this pose, or that of a neighbour"),
    ),
}  # fmt: skip

DROPS = {
    "frame": picture(
        words(LEFT, 18, "A frame ends once: as published, or with one of these reasons", anchor="start"),
        boxes(("arrives", "is matched", "is worked on", "published"), 30, QUIET),
        falls(60, 56, ("malformed", "same_camera, known", "odd_stamp", "late", "surplus", "inactive")),
        falls(160, 56, ("unmatched", "queue_full", "time_jump")),
        falls(260, 56, ("overtaken", "refused", "bug", "disabled", "reset")),
        height=185,
    ),
    "constraint": picture(
        words(LEFT, 18, "A constraint at the mapper", anchor="start"),
        boxes(("arrives", "waits for odometry", "in the map"), 30, QUIET),
        falls(75, 56, ("two_clocks", "unknown_robot", "disabled", "retracted")),
        falls(205, 56, ("before_odometry", "odometry_gap", "odometry_leap", "implausible", "time_jump, reset")),
        height=170,
    ),
}
