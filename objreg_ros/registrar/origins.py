# SPDX-License-Identifier: Apache-2.0
"""Keyframes that were made elsewhere, under the numbers of this store: each once, in the order of their stamps."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

from objreg_ros.data.closures import framed
from objreg_ros.keyframes.frame_window import Arrival, Clock, SessionNumbers
from objreg_ros.memory.compact import unpack_keyframe
from objreg_ros.memory.store import Store
from objreg_ros.registration.keyframe import Keyframe


class Origins:
    """Sessions of keyframers elsewhere, and the numbers that they have here: the same ones after a restart."""

    def __init__(self, store: Store, numbers: SessionNumbers) -> None:
        self._numbers = numbers
        self._known: dict[str, dict[int, int]] = {}  # by robot and run, the number here by that there
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
        run = f"{keyframe.robot} {arrival.run}"  # what one robot sent may be played again as another's
        known = self._known.setdefault(run, {})
        since = [here for there, here in sorted(known.items()) if arrival.clock.session <= there <= keyframe.session]
        began = since[0] if since else self._number(known, arrival.clock.session)
        session = self._number(known, keyframe.session)
        if keyframe.stamp_ns <= self._newest_ns.get(session, keyframe.stamp_ns - 1):
            return None
        self._newest_ns[session] = keyframe.stamp_ns
        received = replace(keyframe, session=session, origin=f"{run}/{keyframe.session}")
        return received, Clock(arrival.clock.began_ns, began)

    def _number(self, known: dict[int, int], there: int) -> int:
        if there not in known:
            known[there] = self._numbers.next_number()
        return known[there]


class Sent(Protocol):
    """A packed keyframe as its keyframer names it."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def frame_id(self) -> str: ...
    @property
    def run(self) -> str: ...
    @property
    def began_ns(self) -> int: ...
    @property
    def first(self) -> int: ...
    @property
    def packed(self) -> bytes: ...


def arrival_of(robot: str, sent: Sent) -> Arrival:
    """The keyframe that a robot sent, with its frame under the robot's prefix. ValueError where it is damaged."""
    keyframe = unpack_keyframe(sent.packed)
    got, expected = (keyframe.stamp_ns, keyframe.frame_id), (sent.stamp_ns, sent.frame_id)
    if got != expected:
        raise ValueError(f"keyframe: expected the stamp and frame {expected} of its header, got {got}")
    named = replace(keyframe, robot=robot, frame_id=framed(robot, keyframe.frame_id))
    return Arrival(named, Clock(sent.began_ns, sent.first), sent.run)
