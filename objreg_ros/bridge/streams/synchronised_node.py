# SPDX-License-Identifier: Apache-2.0
"""A node with several inputs that belong together by their time."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from itertools import chain, count
from typing import Any

from rclpy.clock import Clock, ClockType

from objreg_ros.bridge.node.common import StreamDiagnostics
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.streams.sync import Drop, Match, Need, Stream, Synchroniser
from objreg_ros.diagnostics import Diagnostics

ALONE_S = 0.5  # after once to twice this a stamp that has leapt alone is believed, later where the stream is slow
QUIET_S = 5.0  # where no stream has spoken for so long, what waits for an optional one goes without
EARLY = 30  # messages of a stream that are kept until it is known how they are matched

SURPLUS_ADVICE = "each is of a picture that detector.max_rate leaves out; set that to 0"

Early = tuple[int, str, int, Any]  # order of arrival, stream, stamp, payload


class SynchronisedNode(NodeBase):
    """Hands a `Match` to the worker for every message of the first stream that found its partners.

    That first stream is what the counters count. `start_matching` says how streams are matched; the newest
    `EARLY` messages that each stream was fed before then wait.
    """

    def prepare(self) -> None:
        """As any node; nothing is matched yet."""
        super().prepare()
        self._early: defaultdict[str, deque[Early]] = defaultdict(lambda: deque(maxlen=EARLY))
        self._order = count()
        self._sync: Synchroniser | None = None
        self._reference = ""
        self._received, self._quiet_s = 0, 0.0  # messages of all streams, and since when no more
        self.create_timer(ALONE_S, self._look_after, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def start_matching(self, streams: Sequence[Stream]) -> None:
        """Start matching; what was fed to streams that are not among these is forgotten.

        Where streams were matched before, those frames end by what has come, and latched values stay.
        """
        before = self._sync
        if before is not None:
            self._hand_over(before.flush())
        self._reference = streams[0].name
        self._sync = Synchroniser(streams, self._unmatched)
        for name, payload in (before.latched if before is not None else {}).items():
            self.feed(name, 0, payload)
        for _, *item in sorted(chain(*self._early.values()), key=lambda early: early[0]):
            self.feed(*item)
        self._early.clear()

    @property
    def begun(self) -> bool:
        """Whether it is known how the streams are matched."""
        return self._sync is not None

    def feed(self, name: str, stamp_ns: int, payload: Any) -> None:
        """One message of a stream."""
        if self._sync is None:
            self._early[name].append((next(self._order), name, stamp_ns, payload))
        elif name in self._sync.queues:
            if name == self._reference:
                self.accept(stamp_ns)
            self._hand_over(self._sync.add_item(name, stamp_ns, payload))

    def _look_after(self) -> None:
        """Hand over the frames that wait for a message that may never come. A timer calls this every `ALONE_S`.

        A stamp far from the others is taken for a jump of the clock if nothing contradicts it for that time. After
        `QUIET_S` without any message, frames are handed over without the optional messages that they lack.
        """
        if self._sync is None:
            return
        self._hand_over(self._sync.believe(round(1e9 * ALONE_S)))
        received = self._sync.received
        self._quiet_s = self._quiet_s + ALONE_S if received == self._received else 0.0
        self._received = received
        if self._quiet_s >= QUIET_S:
            self._hand_over(self._sync.wait_no_longer())

    def _hand_over(self, matches: Iterable[Match]) -> None:
        for match in matches:
            if match.is_surplus:
                self._pass_over(match.stamp_ns)
            elif self.let_in(match.stamp_ns):
                self.worker.put((match.stamp_ns, match))

    def _pass_over(self, stamp_ns: int) -> None:
        """End a frame whose picture was left out: no trouble, unless that is so of every frame."""
        self.leave_out(stamp_ns, Drop.SURPLUS.value)
        self._drops.drop("frames", Drop.SURPLUS.value, SURPLUS_ADVICE)

    def _unmatched(self, name: str, stamp_ns: int, why: str) -> None:
        if name == self._reference:
            self.drop(stamp_ns, why, self._wanting(stamp_ns, why))

    def _wanting(self, stamp_ns: int, why: str) -> str:
        """A description of what a frame without a partner waited for."""
        if why == Drop.LATE.value:
            return "one with a later stamp came before it"
        if why == Drop.ODD_STAMP.value:
            return "its stamp is far from those before and after it"
        if self._sync is None or why == Drop.TIME_JUMP.value:
            return "time went back to before it while it waited"
        wanted = " and ".join(map(_partner, self._sync.lacking(stamp_ns)))
        return f"expected {wanted}, got none; does its node run and keep up?"

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """What the other streams have brought, and how much of it found no partner."""
        queues = {} if self._sync is None else self._sync.queues
        others = {name: queue for name, queue in queues.items() if name != self._reference}
        received = {name: queue.received for name, queue in others.items()}
        unused = {(name, why): count for name, queue in others.items() for why, count in queue.dropped.items()}
        return (*super().own_diagnostics(), StreamDiagnostics(received=received, unused=unused))


def _partner(stream: Stream) -> str:
    if stream.need is Need.LATCHED:
        return f"{stream.name} before it"
    slop = f"within {stream.slop_ns * 1e-6:g} ms of it (slop)" if stream.slop_ns else "of its very stamp"
    return f"{stream.name} {slop}"
