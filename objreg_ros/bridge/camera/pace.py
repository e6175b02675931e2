# SPDX-License-Identifier: Apache-2.0
"""Which pictures of a fast camera go on: a keyframe is made of a few, and more of them add nothing new."""

from __future__ import annotations

from objreg_ros.data.frames import JUMP_NS

EARLY = 0.1  # of the period: so much before it is due a picture may come
TURN = 6  # pictures that go on; then one is left out that is due


class RateLimit:
    """Lets ``max_rate`` pictures a second through on average, by their stamps; 0: every one.

    After every `TURN` one more is left out where some are: depth that comes with every third picture would else always
    come with one that is left out. A clock that jumps back begins anew. One that stands still gives no rate, so every
    picture goes on.
    """

    def __init__(self, max_rate: float) -> None:
        self._period_ns = round(1e9 / max_rate) if max_rate > 0 else 0
        self._due_ns: int | None = None  # when the next one is
        self._last_ns = 0  # of the last picture that went on
        self._left_out, self._through = False, 0  # whether some were since, and how many went on in this turn

    def admits(self, stamp_ns: int) -> bool:
        """Whether the picture of a stamp goes on; to be asked once a picture, as they come."""
        if self._period_ns == 0:
            return True
        if self._due_ns is None or stamp_ns - self._last_ns <= -JUMP_NS:
            self._due_ns, self._left_out, self._through = stamp_ns, False, 0
        late_ns = stamp_ns - self._due_ns
        if late_ns < -EARLY * self._period_ns and stamp_ns != self._last_ns:
            self._left_out = True
            return False
        if self._left_out and self._through >= TURN:
            self._due_ns = None  # the next one is, and sets the time
            return False
        self._due_ns = (self._due_ns if late_ns < self._period_ns else stamp_ns) + self._period_ns
        self._last_ns, self._left_out = stamp_ns, False
        self._through += 1
        return True
