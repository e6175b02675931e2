# SPDX-License-Identifier: Apache-2.0
"""Whether odometry goes on, errs once, or has begun anew: several that agree with each other decide."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

import numpy as np

from objreg_ros.data.frames import JUMP_NS, Odometry
from objreg_ros.geometry import leaps

AGREEING = 3  # poses that go on from each other and not from the map are a new session; fewer are errors
AHEAD_NS = 60_000_000_000  # a stamp that leaps so far ahead is believed once others follow it


class Anew(Enum):
    """Why a new map begins; the value is the reason that the counters show."""

    TIME = "time_jump"
    PLACE = "odometry_leap"


class Admitted(NamedTuple):
    """The poses that may be taken in now, and why they begin a new map, if they do."""

    poses: tuple[Odometry, ...] = ()
    anew: Anew | None = None


class Restart:
    """Holds what does not go on from the newest pose until `AGREEING` agree; else it was wrong: given to ``on_wrong``.

    Wrong is a pose that leaps and comes back, a stamp of another time, and a pose that comes again or late.
    """

    def __init__(self, max_speed: float, on_wrong: Callable[[Odometry], None]) -> None:
        self._max_speed, self._on_wrong = max_speed, on_wrong
        self._held: list[Odometry] = []
        self._newest: Odometry | None = None

    def admit(self, odometry: Odometry) -> Admitted:
        """What becomes of the next pose."""
        if self._newest is None:
            return self._take((odometry,))
        if self._held and self._agrees(self._held[-1], self._newest, odometry):
            self._held.append(odometry)
            return self._several(self._newest)
        if self._follows(self._newest, odometry):
            self._let_go()
            return self._take((odometry,))
        if 0 <= self._newest.stamp_ns - odometry.stamp_ns < JUMP_NS:
            self._on_wrong(odometry)
            return Admitted()
        self._let_go()
        self._held.append(odometry)
        return Admitted()

    def _take(self, poses: tuple[Odometry, ...], anew: Anew | None = None) -> Admitted:
        self._newest = poses[-1]
        return Admitted(poses, anew)

    def _let_go(self) -> None:
        held, self._held = self._held, []
        for odometry in held:
            self._on_wrong(odometry)

    def _several(self, newest: Odometry) -> Admitted:
        """Nothing yet, or a new session with all that is held. The old one goes on where but time went ahead."""
        if len(self._held) < AGREEING:
            return Admitted()
        held, self._held = tuple(self._held), []
        if held[0].stamp_ns <= newest.stamp_ns:
            return self._take(held, Anew.TIME)
        return self._take(held, Anew.PLACE if self._leaps(newest, held[0]) else None)

    def _agrees(self, held: Odometry, newest: Odometry, odometry: Odometry) -> bool:
        """Whether a pose goes on from what is held, and better so than from the newest of the map."""
        if not self._follows(held, odometry) or odometry.stamp_ns - held.stamp_ns > abs(
            odometry.stamp_ns - newest.stamp_ns
        ):
            return False
        return not self._follows(newest, odometry) or _apart(held, odometry) < _apart(newest, odometry)

    def _follows(self, before: Odometry, after: Odometry) -> bool:
        return 0 < after.stamp_ns - before.stamp_ns < AHEAD_NS and not self._leaps(before, after)

    def _leaps(self, before: Odometry, after: Odometry) -> bool:
        seconds = 1e-9 * (after.stamp_ns - before.stamp_ns)
        return leaps(before.T_odom_body, after.T_odom_body, seconds, self._max_speed, np.eye(4))


def _apart(a: Odometry, b: Odometry) -> float:
    """How far two poses are from each other, m and rad together."""
    difference = a.T_odom_body[:3] - b.T_odom_body[:3]
    return float(np.linalg.norm(difference))
