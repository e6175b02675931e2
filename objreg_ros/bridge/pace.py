# SPDX-License-Identifier: Apache-2.0
"""Which pictures of a fast camera go on: a keyframe is made of a few, and more of them tell nothing new."""

from __future__ import annotations

from objreg_ros.data import JUMP_NS

TOLERANCE = 0.1  # of the period: 30 Hz with jitter give every third picture at 10 Hz, never every second or fourth


class Pace:
    """Lets at most ``max_rate`` pictures a second through, by their stamps; 0: every one.

    A clock that jumps back begins anew. One that stands still tells no pace, so that every picture goes on.
    """

    def __init__(self, max_rate: float) -> None:
        self._least_ns = round((1.0 - TOLERANCE) * 1e9 / max_rate) if max_rate > 0 else 0
        self._last_ns: int | None = None  # of the last picture that went on

    def admits(self, stamp_ns: int) -> bool:
        """Whether the picture of a stamp goes on; to be asked once a picture, as they come."""
        passed_ns = None if self._last_ns is None else stamp_ns - self._last_ns
        if passed_ns is not None and -JUMP_NS < passed_ns < self._least_ns and passed_ns != 0:
            return False
        self._last_ns = stamp_ns
        return True
