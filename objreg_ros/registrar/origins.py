# SPDX-License-Identifier: Apache-2.0
"""Keyframes that were made elsewhere, under the numbers of this store: each once, in the order of their stamps."""

from __future__ import annotations

from dataclasses import replace

from objreg_ros.keyframes.frame_window import Arrival, Clock, SessionNumbers
from objreg_ros.memory.store import Store
from objreg_ros.registration.keyframe import Keyframe


class Origins:
    """Sessions of keyframers elsewhere, and the numbers that they have here: the same ones after a restart."""

    def __init__(self, store: Store, numbers: SessionNumbers) -> None:
        self._numbers = numbers
        self._known: dict[str, dict[int, int]] = {}  # by run, the number here by that there
        self._newest_ns: dict[int, int] = {}  # of each session
        for origin, (session, stamp_ns) in store.origins().items():
            run, _, there = origin.rpartition("/")
            self._known.setdefault(run, {})[int(there)] = session
            self._newest_ns[session] = stamp_ns

    def received(self, arrival: Arrival) -> tuple[Keyframe, Clock] | None:
        """A keyframe and its clock by the numbers of this store; None for one that was received before.

        Those of a session come in the order of their stamps.
        """
        keyframe = arrival.keyframe
        known = self._known.setdefault(arrival.run, {})
        since = [here for there, here in sorted(known.items()) if arrival.clock.session <= there <= keyframe.session]
        began = since[0] if since else self._number(known, arrival.clock.session)
        session = self._number(known, keyframe.session)
        if keyframe.stamp_ns <= self._newest_ns.get(session, keyframe.stamp_ns - 1):
            return None
        self._newest_ns[session] = keyframe.stamp_ns
        received = replace(keyframe, session=session, origin=f"{arrival.run}/{keyframe.session}")
        return received, Clock(arrival.clock.began_ns, began)

    def _number(self, known: dict[int, int], there: int) -> int:
        if there not in known:
            known[there] = self._numbers.take()
        return known[there]
