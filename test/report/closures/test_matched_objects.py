# SPDX-License-Identifier: Apache-2.0
"""What closed a pair is in one colour in both pictures; the rest is grey."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure, ObjectMatch, Reason, Rejected
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, transform
from objreg_tools.report.closures.matched_objects import Match, drawing, marks_of, matches_of, seen_in, seen_object
from objreg_tools.report.run.rows import Glimpse

CAMERA = Intrinsics(fx=500.0, fy=500.0, cx=319.5, cy=239.5, width=640, height=480)
T_FROM_TO = pose(np.eye(3), np.array([0.2, 0.0, 0.0]))
CUP, BOOK = np.array([0.1, 0.0, 1.5]), np.array([-0.3, 0.1, 1.8])
BOX = "400,300 500,300 500,400 400,400"


def frame(objects: list[tuple[str, np.ndarray]], outlines: bool = True) -> Glimpse:
    return Glimpse(0, objects=tuple(objects), outlines=(BOX,) * len(objects) if outlines else ())


def at_to(xyz: np.ndarray) -> np.ndarray:
    return transform(inverse(T_FROM_TO), xyz)


FIRST = frame([("cup", CUP), ("book", BOOK), ("tv", np.array([0.0, 0.0, 3.0]))])
SECOND = frame([("book", at_to(BOOK)), ("cup", at_to(CUP) + 0.02), ("thing", np.array([0.4, 0.0, 2.0]))])


def closure(*labels: str, **other: Any) -> LoopClosure:
    fields = {"from_ns": 0, "to_ns": 9, "T_from_to": T_FROM_TO, "covariance": np.eye(6), "labels": labels}
    return LoopClosure(**{**fields, **other})


def pairs(
    outcome: LoopClosure | Rejected, first: Glimpse = FIRST, second: Glimpse = SECOND
) -> list[tuple[str, bool, bool]]:
    found = matches_of(outcome, seen_in(first), seen_in(second))
    return [(match.label, match.first is not None, match.second is not None) for match in found]


def test_what_closed_it_is_matched_and_what_lies_there_besides_is_not() -> None:
    assert pairs(closure("cup")) == [("cup", True, True)]
    assert {*pairs(closure("cup", "book"))} == {("cup", True, True), ("book", True, True)}


def test_as_many_of_a_label_are_matched_as_closed_it() -> None:
    two = frame([("cup", CUP), ("cup", BOOK)]), frame([("cup", at_to(CUP)), ("cup", at_to(BOOK))])
    one = closure("cup", objects=(ObjectMatch(label="cup", object_id=1),))
    both = closure("cup", objects=(ObjectMatch(label="cup", object_id=1), ObjectMatch(label="cup", object_id=2)))
    assert len(pairs(one, *two)) == 1 and len(pairs(both, *two)) == 2


def test_a_refused_pose_shows_what_it_lays_on_each_other_and_one_without_a_pose_nothing() -> None:
    refused = Rejected(reason=Reason.TEXTURE, from_ns=0, to_ns=9, detail="", T_from_to=T_FROM_TO)
    assert {label for label, *_ in pairs(refused)} == {"cup", "book"}
    assert pairs(Rejected(reason=Reason.TEXTURE, from_ns=0, to_ns=9, detail="")) == []


def test_a_match_has_one_colour_in_both_pictures_a_name_in_each_and_a_line_between() -> None:
    marks = drawing(closure("cup"), (FIRST, SECOND), (CAMERA, CAMERA)).marks
    assert marks.count('<polygon class="mark m0"') == 2 and marks.count(">cup</text>") == 2
    (line,) = re.findall(r'<line class="mark m0" x1="(\d+)" y1="\d+" x2="(\d+)"', marks)
    assert int(line[0]) < 320 and int(line[1]) > 328
    assert marks.count('<polygon class="mark other"') == 4 and ">tv</text>" in marks and ">thing<" not in marks


def test_an_object_that_one_frame_lacks_is_drawn_where_the_pose_puts_it() -> None:
    without = frame([("book", at_to(BOOK))])
    marks = drawing(closure("cup"), (FIRST, without), (CAMERA, CAMERA)).marks
    (x,) = re.findall(r'<circle class="mark m0 guessed" cx="(\d+)"', marks)
    expected = (500.0 * at_to(CUP)[0] / at_to(CUP)[2] + 319.5) / 2 + 328
    assert int(x) == pytest.approx(expected, abs=1.0)


def test_what_neither_picture_shows_is_named() -> None:
    drawn = drawing(closure("cup", "mouse"), (FIRST, SECOND), (CAMERA, CAMERA))
    assert drawn.lacking == ("mouse",) and drawn.height == 240
    assert drawing(closure("cup"), (None, None), (CAMERA, CAMERA)).marks == ""


def test_objects_without_outlines_have_circles() -> None:
    bare = [frame(list(one.objects), outlines=False) for one in (FIRST, SECOND)]
    marks = drawing(closure("cup"), (bare[0], bare[1]), (CAMERA, CAMERA)).marks
    assert marks.count('<circle class="mark m0"') == 2 and "polygon" not in marks


def test_an_object_of_points_has_the_outline_of_its_points() -> None:
    corners = np.array([[-0.3, -0.3, 2.0], [0.3, -0.3, 2.0], [0.3, 0.3, 2.0], [-0.3, 0.3, 2.0], [0.0, 0.0, 2.0]])
    one = seen_object("box", corners, CAMERA)
    expected = [(319.5 + 500.0 * x / 2.0) / 2 for x in (-0.3, 0.3)]
    assert np.unique(one.outline[:, 0]) == pytest.approx(expected, abs=0.5)
    marks = marks_of(([one], [one]), [Match("box", one, one)], (CAMERA, CAMERA), None)
    assert marks.count('<polygon class="mark m0"') == 2 and marks.count('<line class="mark m0"') == 1


def test_what_moved_is_tied_by_a_line_and_says_how_far() -> None:
    moved = frame([("book", at_to(BOOK)), ("cup", at_to(CUP) + np.array([0.4, 0.0, 0.0]))])
    marks = drawing(closure("book", evidence={"moved cup [m]": 0.4}), (FIRST, moved), (CAMERA, CAMERA)).marks
    assert marks.count("cup, moved 0.40 m") == 2 and '<line class="mark m1 moved"' in marks


def test_names_are_escaped_and_do_not_cover_each_other() -> None:
    crowd = frame([("<b>", CUP), ("saucer", CUP), ("spoon", CUP)])
    marks = drawing(closure("cup"), (crowd, None), (CAMERA, CAMERA)).marks
    heights = [int(y) for y in re.findall(r'<text [^>]* y="(\d+)"', marks)]
    assert "<b>" not in marks and "&lt;b&gt;" in marks and min(np.diff(sorted(heights))) >= 14
