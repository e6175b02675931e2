# SPDX-License-Identifier: Apache-2.0
"""The order in which frames came, for those that would be done before one that came earlier. Knows no ROS."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(slots=True)
class _Place:
    stamp_ns: int
    frame_id: str | None = None  # of one that is put off
    ended: bool = False


class FrameOrder:
    """Puts frames off until those before them have ended: ``due`` is given stamp and frame id of each whose turn it is.

    Safe to use from the executor and the worker at once; ``due`` is called by one of them at a time, in order.
    """

    def __init__(self, due: Callable[[int, str], None]) -> None:
        self._due = due
        self._lock = threading.Lock()
        self._line: deque[_Place] = deque()

    def begin_frame(self, stamp_ns: int) -> None:
        """A frame came that will have its `end_frame`."""
        with self._lock:
            self._line.append(_Place(stamp_ns))

    def put_off(self, stamp_ns: int, frame_id: str) -> None:
        """A frame came that is only to have its turn."""
        with self._lock:
            self._line.append(_Place(stamp_ns, frame_id))
            self._advance()

    def end_frame(self, stamp_ns: int) -> None:
        """A frame that began has ended."""
        with self._lock:
            at_work = (place for place in self._line if place.stamp_ns == stamp_ns and place.frame_id is None)
            place = next((place for place in at_work if not place.ended), None)
            if place is not None:
                place.ended = True
            self._advance()

    def _advance(self) -> None:
        while self._line and (self._line[0].ended or self._line[0].frame_id is not None):
            place = self._line.popleft()
            if place.frame_id is not None:
                self._due(place.stamp_ns, place.frame_id)
