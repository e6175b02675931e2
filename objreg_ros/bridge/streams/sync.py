# SPDX-License-Identifier: Apache-2.0
"""Streams of stamped items synchronised by time; knows neither ROS nor what the items are.

The first stream is the reference: every match is one of its items with the nearest item of each other stream, or with
those before and after it. Nothing is lost in silence: for every stream
``received = matched + waiting + dropped by reason``.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from objreg_ros.bridge.streams.clock_monitor import ClockMonitor
from objreg_ros.data.frames import JUMP_NS


class Need(Enum):
    """What a match does without an item of a stream."""

    REQUIRED = "required"  # there is no match; an item serves one match, of the reference's nearest
    OPTIONAL = "optional"  # it goes without; waited for while the stream speaks; an item may serve many matches
    LATCHED = "latched"  # the last value serves whatever its stamp; there is no match before the first


SILENCE_NS = 1_000_000_000  # an optional stream that is so far behind has stopped: nothing waits for it
PATIENCE_NS = 2_000_000_000  # what waits longer, and is not among the last ``depth``, is dropped
MOST_BYTES = 200_000_000  # so is what is over this size, whatever its time
ENCLOSING = 7  # times the slop: 0.14 s for one of 20 ms, so that 10 Hz are enough


class Drop(Enum):
    """Why an item met no match. The value is what diagnostics show."""

    UNMATCHED = "unmatched"  # its time has passed and no partner came
    QUEUE_FULL = "queue_full"  # it waited for a partner until the queue was full
    TIME_JUMP = "time_jump"  # time jumped back and left it in the future
    LATE = "late"  # one of its stream with a later stamp was there before it
    ODD_STAMP = "odd_stamp"  # its stamp leapt far away, and the next one's did not
    SURPLUS = "surplus"  # its picture was left out to keep a pace; a stream that has it as a payload says so


@dataclass(slots=True)
class QueuedMessage:
    """One stamped item that waits."""

    stamp_ns: int
    payload: Any
    used: bool = False


@dataclass(frozen=True, slots=True)
class Stream:
    """How one input is treated: ``slop_ns`` is the largest distance in time to the reference, 0 for exact.

    The last ``depth`` items wait as long as it takes, more of them for `PATIENCE_NS` if they are not too large: a slow
    detector's result comes when its depth image is many images old. Of an ``enclosing`` one a match gets a tuple: the
    item of exactly its time, or those before and after it where they are at most `ENCLOSING` times the slop apart, or
    the nearest. An ``expected`` one is known to send, and is waited for from the start.
    """

    name: str
    need: Need = Need.REQUIRED
    slop_ns: int = 0
    depth: int = 10
    enclosing: bool = False
    expected: bool = False

    def __post_init__(self) -> None:
        if self.enclosing and self.need is not Need.OPTIONAL:
            raise ValueError(
                f"{self.name}: expected an enclosing stream to be optional, as its items serve many matches"
            )


@dataclass(frozen=True, slots=True)
class Match:
    """One payload a stream, a tuple of an enclosing one, by name; None where an optional one had nothing near."""

    stamp_ns: int
    payloads: Mapping[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.payloads[name]

    @property
    def is_surplus(self) -> bool:
        """Whether it is of what was left out on purpose: it is to be dropped as `Drop.SURPLUS`."""
        return any(payload is Drop.SURPLUS for payload in self.payloads.values())


@dataclass(slots=True)
class Queue:
    """The items of one stream and what became of them."""

    stream: Stream
    on_drop: Callable[[str, int, str], None]
    items: deque[QueuedMessage] = field(default_factory=deque)
    last_ns: int | None = None
    period_ns: int | None = None  # between its last two
    latched: Any = None
    received: int = 0
    matched: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    clock: ClockMonitor[Any] = field(init=False)

    def __post_init__(self) -> None:
        self.clock = ClockMonitor(
            lambda stamp_ns, payload: self._let_go(QueuedMessage(stamp_ns, payload), Drop.ODD_STAMP)
        )

    @property
    def crowded(self) -> bool:
        """Whether the oldest item must go."""
        if len(self.items) <= self.stream.depth:
            return False
        waited_ns = self.items[-1].stamp_ns - self.items[0].stamp_ns
        bytes_held = len(self.items) * _size(self.items[-1].payload)  # those of one stream are about alike
        return waited_ns > PATIENCE_NS or bytes_held > MOST_BYTES

    @property
    def waiting(self) -> int:
        """Items that no match has used yet."""
        return sum(not item.used for item in self.items) + self.clock.holding

    def nearest(self, stamp_ns: int) -> QueuedMessage | None:
        """The item nearest to a time within the slop; None if there is none. The earlier of two that are as near."""
        near = min(self.items, key=lambda item: abs(item.stamp_ns - stamp_ns), default=None)
        return near if near is not None and abs(near.stamp_ns - stamp_ns) <= self.stream.slop_ns else None

    def partners(self, stamp_ns: int) -> tuple[QueuedMessage, ...]:
        """What goes with a time, the earlier first; one item at most, or two that enclose it. Empty for none."""
        near = self.nearest(stamp_ns)
        if self.stream.enclosing and (near is None or near.stamp_ns != stamp_ns):
            before = next((item for item in reversed(self.items) if item.stamp_ns < stamp_ns), None)
            after = next((item for item in self.items if item.stamp_ns > stamp_ns), None)
            most = ENCLOSING * self.stream.slop_ns
            if before is not None and after is not None and after.stamp_ns - before.stamp_ns <= most:
                return before, after
        return () if near is None else (near,)

    def lacks(self, stamp_ns: int) -> bool:
        """Whether there can be no match at a time for want of an item of this stream."""
        if self.stream.need is Need.LATCHED:
            return self.latched is None
        return self.stream.need is Need.REQUIRED and not self.partners(stamp_ns)

    def settled(self, stamp_ns: int) -> bool:
        """Whether no item that may still come can be nearer to a time than those that are here."""
        if self.last_ns is None:
            return self.stream.need is Need.OPTIONAL and not self.stream.expected
        return self.last_ns > stamp_ns or any(item.stamp_ns == stamp_ns for item in self.items)

    def takes(self, stamp_ns: int, item: QueuedMessage) -> bool:
        """Whether an item of the reference at a time would have this one for its match, and no other may."""
        return self.stream.need is Need.REQUIRED and self.nearest(stamp_ns) is item

    def enqueue(self, item: QueuedMessage) -> None:
        """Take an item in."""
        self.period_ns = None if self.last_ns is None else item.stamp_ns - self.last_ns
        self.last_ns = item.stamp_ns
        self.items.append(item)

    def is_late(self, stamp_ns: int) -> bool:
        """Whether an item came after a later one of its stream, and time has not begun anew."""
        return self.last_ns is not None and 0 < self.last_ns - stamp_ns < JUMP_NS

    def refuse(self, stamp_ns: int) -> None:
        """Count an item that came late."""
        self._let_go(QueuedMessage(stamp_ns, None), Drop.LATE)

    def use(self, item: QueuedMessage) -> None:
        """Count an item as matched, once."""
        self.matched += not item.used
        item.used = True

    def drop_oldest(self, why: Drop) -> None:
        """Take the oldest item out and count it if nothing used it."""
        self._let_go(self.items.popleft(), why)

    def drop_before(self, stamp_ns: int) -> None:
        """Take out what is older than a time."""
        while self.items and self.items[0].stamp_ns < stamp_ns:
            self.drop_oldest(Drop.UNMATCHED)

    def drop_after(self, stamp_ns: int) -> None:
        """Take out what lies in the future of a time that was jumped back to."""
        if not self.items or self.items[-1].stamp_ns <= stamp_ns:
            return
        held, self.items = self.items, deque(item for item in self.items if item.stamp_ns <= stamp_ns)
        for item in held:
            if item.stamp_ns > stamp_ns:
                self._let_go(item, Drop.TIME_JUMP)

    def _let_go(self, item: QueuedMessage, why: Drop) -> None:
        if not item.used:
            self.dropped[why.value] += 1
            self.on_drop(self.stream.name, item.stamp_ns, why.value)


class Synchroniser:
    """Matches the items of several streams. `add_item` returns the matches that an item completes, in order of time.

    A stream whose stamps go back by `JUMP_NS`, two of them, has jumped in time (a looped bag): what waits with a later
    stamp is dropped as ``time_jump``, in every stream, and matching starts afresh. One alone is an ``odd_stamp``.
    ``on_drop`` receives every item that met no match: the stream's name, the stamp and the reason.
    """

    def __init__(
        self, streams: Sequence[Stream], on_drop: Callable[[str, int, str], None] = lambda name, stamp_ns, why: None
    ) -> None:
        if not streams or streams[0].need is not Need.REQUIRED:
            raise ValueError("expected a required stream first: it is the reference that the others are matched to")
        self.queues = {stream.name: Queue(stream, on_drop) for stream in streams}
        self._reference = self.queues[streams[0].name]
        self._others = [queue for queue in self.queues.values() if queue is not self._reference]
        self._partners_first = [*self._others, self._reference]  # lest a match goes without what it need not have

    def add_item(self, name: str, stamp_ns: int, payload: Any) -> list[Match]:
        """Take one item of a stream; KeyError for a stream that was not named."""
        queue = self.queues[name]
        queue.received += 1
        if queue.stream.need is Need.LATCHED:
            queue.latched, queue.matched = payload, queue.matched + 1
            return self._matches()
        admitted = queue.clock.admit(stamp_ns, payload)
        return [match for item in admitted for match in self._take(queue, *item)]

    def _take(self, queue: Queue, stamp_ns: int, payload: Any) -> list[Match]:
        if queue.is_late(stamp_ns):
            queue.refuse(stamp_ns)
            return []
        if queue.last_ns is not None and stamp_ns < queue.last_ns:
            self._forget_after(stamp_ns)
        queue.drop_after(stamp_ns)  # another stream's jump may have left what lies in the future of this one's
        queue.enqueue(QueuedMessage(stamp_ns, payload))
        return [*self._matches(), *self._make_space(queue)]

    def believe(self, passed_ns: int) -> list[Match]:
        """The matches by what has leapt in time alone and is believed: see `ClockMonitor.believe`."""
        found = [(queue, item) for queue in self._partners_first for item in queue.clock.believe(passed_ns)]
        return [match for queue, item in found for match in self._take(queue, *item)]

    def wait_no_longer(self) -> list[Match]:
        """The matches of what waits for nothing but optional streams: for when nothing has come for a while.

        The last frame before a camera stops waits for odometry that may have stopped with it.
        """
        found = []
        while self._reference.items and not self.lacking(self._reference.items[0].stamp_ns):
            found += self._resolve(self._reference.items[0])
        return found

    def flush(self) -> list[Match]:
        """The matches that are still possible when nothing more will come; the rest is dropped as unmatched."""
        ended = [(queue, item) for queue in self._partners_first for item in queue.clock.release_held()]
        found = [match for queue, item in ended for match in self._take(queue, *item)]
        while self._reference.items:
            found += self._resolve(self._reference.items[0])
        for queue in self._others:
            while queue.items:
                queue.drop_oldest(Drop.UNMATCHED)
        return found

    @property
    def latched(self) -> dict[str, Any]:
        """The last value of every latched stream that has spoken."""
        return {name: queue.latched for name, queue in self.queues.items() if queue.latched is not None}

    @property
    def received(self) -> int:
        """How many items have come, of all streams."""
        return sum(queue.received for queue in self.queues.values())

    def lacking(self, stamp_ns: int) -> list[Stream]:
        """The streams that a match at a time needs and that have nothing for it now."""
        return [queue.stream for queue in self._others if queue.lacks(stamp_ns)]

    def _forget_after(self, stamp_ns: int) -> None:
        for queue in self.queues.values():
            queue.drop_after(stamp_ns)
            queue.last_ns = None

    def _matches(self) -> list[Match]:
        found = []
        while self._reference.items and self._decided(self._reference.items[0]):
            found += self._resolve(self._reference.items[0])
        return found

    def _decided(self, item: QueuedMessage) -> bool:
        """Whether the fate of a reference item is known: waiting longer would change nothing."""
        for queue in self._others:
            if queue.stream.need is Need.LATCHED:
                if queue.latched is None:
                    return False
            elif not queue.settled(item.stamp_ns) and not self._silent(queue):
                return False
        return not self._may_give_way(item)

    def _may_give_way(self, item: QueuedMessage) -> bool:
        """Whether the next reference item is nearer to a partner, and is only due or may meet a nearer one yet."""
        items, period_ns = self._reference.items, self._reference.period_ns
        if len(items) > 1:
            next_ns = items[1].stamp_ns
            return any(
                _is_nearer(next_ns, item, partner) and not queue.settled(next_ns)
                for queue, partner in self._sole_partners(item)
            )
        due_ns = item.stamp_ns + (period_ns or 0)
        return any(_is_nearer(due_ns, item, partner) for _, partner in self._sole_partners(item))

    def _gives_way(self, item: QueuedMessage) -> bool:
        """Whether the next reference item is nearer to a partner that serves one match, and will have it."""
        if len(self._reference.items) < 2:
            return False
        next_ns = self._reference.items[1].stamp_ns
        return any(
            _is_nearer(next_ns, item, partner) and queue.takes(next_ns, partner)
            for queue, partner in self._sole_partners(item)
        )

    def _sole_partners(self, item: QueuedMessage) -> list[tuple[Queue, QueuedMessage]]:
        """What the streams whose items serve one match have for a reference item."""
        queues = [queue for queue in self._others if queue.stream.need is Need.REQUIRED]
        return [(queue, partner) for queue in queues for partner in queue.partners(item.stamp_ns)]

    def _silent(self, queue: Queue) -> bool:
        """Whether an optional stream has stopped, by the time of the reference."""
        now_ns, last_ns = self._reference.last_ns, queue.last_ns
        stopped = now_ns is not None and last_ns is not None and now_ns - last_ns > SILENCE_NS
        return stopped and queue.stream.need is Need.OPTIONAL

    def _resolve(self, item: QueuedMessage, why: Drop = Drop.UNMATCHED) -> list[Match]:
        """Take the first reference item out: a match, or a drop."""
        partners = {queue.stream.name: queue.partners(item.stamp_ns) for queue in self._others if not _latched(queue)}
        if self.lacking(item.stamp_ns) or self._gives_way(item):
            self._reference.drop_oldest(why)
            return []
        self._reference.use(item)
        self._reference.items.popleft()
        payloads = {queue.stream.name: queue.latched for queue in self._others if _latched(queue)}
        for name, found in partners.items():
            payloads[name] = _payload(self.queues[name].stream, found)
            self._spend(self.queues[name], found)
        return [Match(item.stamp_ns, {self._reference.stream.name: item.payload, **payloads})]

    @staticmethod
    def _spend(queue: Queue, partners: Sequence[QueuedMessage]) -> None:
        for partner in partners:
            queue.use(partner)
        if partners:
            queue.drop_before(partners[0].stamp_ns)
            if queue.stream.need is Need.REQUIRED:
                queue.items.popleft()

    def _make_space(self, queue: Queue) -> list[Match]:
        """Keep a queue within bounds: the oldest reference item goes as it is, the oldest of others is dropped."""
        found: list[Match] = []
        while queue.crowded:
            if queue is self._reference:
                found += self._resolve(queue.items[0], Drop.QUEUE_FULL)
            else:
                queue.drop_oldest(Drop.UNMATCHED if queue.stream.need is Need.OPTIONAL else Drop.QUEUE_FULL)
        return found


def _latched(queue: Queue) -> bool:
    return queue.stream.need is Need.LATCHED


def _is_nearer(stamp_ns: int, item: QueuedMessage, partner: QueuedMessage) -> bool:
    """Whether a time is nearer to a partner than an item is."""
    return abs(stamp_ns - partner.stamp_ns) < abs(item.stamp_ns - partner.stamp_ns)


def _size(payload: Any) -> int:
    """The bytes of a message's data, 0 of what has none."""
    return len(getattr(payload, "data", ()))


def _payload(stream: Stream, partners: Sequence[QueuedMessage]) -> Any:
    if not partners:
        return None
    return tuple(item.payload for item in partners) if stream.enclosing else partners[0].payload
