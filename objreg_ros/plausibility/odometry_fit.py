# SPDX-License-Identifier: Apache-2.0
"""Whether odometry is that of this camera: its turns beside those that the camera was seen to make.

How far something rigid turns is the same wherever it is measured on it. So turns that are not alike under any mount are
those of another robot, or of another time: shifts of up to a minute are tried.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.plausibility.hand_eye import best_rotation, turns_of

LEAST_TURN = np.radians(3.0)  # a smaller one is no evidence
TURN_TOLERANCE, TURN_SHARE = np.radians(2.0), 0.2  # turns that differ by less, or by that share, are alike
LEAST_TURNS = 8
ALIKE, UNLIKE = 0.7, 0.5  # of the turns: above they are of one body, below of two
FOUND = 0.8  # of the turns, for a shift that was searched for
MOST_SHIFT_S, STEP_S, FINE_S = 60.0, 0.1, 0.02
LEAST_SHIFT_S = 0.08  # a smaller one is within what stamps and tracked turns err by
ELSEWHERE_S, CLEARLY = 1.0, 0.75  # another shift is so far away, and turns are off by so much less at the right one


class Likeness(NamedTuple):
    """The ``share`` of turns that agree, of so many ``turns`` of at least `LEAST_TURN`; by how much they are ``off`` on
    average, of what turns that agree may be."""

    share: float
    turns: int
    off: float = 1.0

    @property
    def is_alike(self) -> bool:
        """Whether the turns are those of one body."""
        return self.turns >= LEAST_TURNS and self.share >= ALIKE

    @property
    def is_unlike(self) -> bool:
        """Whether the turns are those of two."""
        return self.turns >= LEAST_TURNS and self.share < UNLIKE


NOTHING = Likeness(0.0, 0)


def likeness(T_body: Array, T_camera: Array, R_body_camera: Array | None = None) -> Likeness:
    """How alike the turns of motions (n, 4, 4) are, under a rotation or under the one that suits them best."""
    if not len(T_body):
        return NOTHING
    return _alike(turns_of(T_body), turns_of(T_camera), R_body_camera)


def _alike(body: Array, camera: Array, R: Array | None) -> Likeness:
    size = np.maximum(np.linalg.norm(body, axis=1), np.linalg.norm(camera, axis=1))
    turning = size > LEAST_TURN
    if not turning.any():
        return NOTHING
    body, camera, size = body[turning], camera[turning], size[turning]
    R = best_rotation(body, camera) if R is None else R
    off = np.linalg.norm(body - camera @ R.T, axis=1) / (TURN_TOLERANCE + TURN_SHARE * size)
    return Likeness(float(np.mean(off < 1.0)), len(size), float(np.mean(np.minimum(off, 1.0))))


class Shift(NamedTuple):
    """By how much later odometry is stamped than the camera, s, and how alike the turns are then."""

    seconds: float
    likeness: Likeness


def find_shift(motions: Callable[[float], tuple[Array, Array]], T_camera: Array, about_s: float = 0.0) -> Shift | None:
    """The shift of stamps within a minute of ``about_s`` by which turns become alike; None where there is none.

    ``motions`` gives the motions (n, 4, 4) of the body for stamps that are so many seconds later, and which are known.
    A shift that is hardly better than none, or than one that is seconds away, is none.
    """
    turns = turns_of(T_camera)

    def at(seconds: float) -> Likeness:
        T_body, known = motions(seconds)
        found = _alike(turns_of(T_body[known]), turns[known], None) if known.any() else NOTHING
        return found if found.turns >= LEAST_TURNS else NOTHING

    grid = about_s + np.arange(-MOST_SHIFT_S, MOST_SHIFT_S + STEP_S / 2, STEP_S)
    coarse = np.array([at(float(seconds)).off for seconds in grid])
    best = float(grid[int(np.argmin(coarse))])
    fine = best + np.arange(-STEP_S, STEP_S + FINE_S / 2, FINE_S)
    found = min((Shift(float(seconds), at(float(seconds))) for seconds in fine), key=lambda shift: shift.likeness.off)
    others = [*coarse[np.abs(grid - best) > ELSEWHERE_S], *([at(0.0).off] if abs(found.seconds) > FINE_S else [])]
    is_distinct = found.likeness.off < CLEARLY * min(others, default=1.0)
    return found if found.likeness.share >= FOUND and is_distinct and abs(found.seconds) >= LEAST_SHIFT_S else None
