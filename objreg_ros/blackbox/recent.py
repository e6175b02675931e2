# SPDX-License-Identifier: Apache-2.0
"""The newest messages of all inputs as bytes, bounded by the time that they span and by their size."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from objreg_ros.data.frames import JUMP_NS

SPARE = 2  # times the seconds of a file are kept: one begins where a keyframe does
BEFORE_NS = 1_000_000_000  # of odometry, IMU and transforms before the first picture: a pose is between two
EARLIER_NS = 200_000_000  # colour may be stamped so long before the depth that it belongs to
OVERHEAD = 200  # bytes of what is around each message
MOST_EARLY = 1000  # messages that wait for the first stamp
KEPT_BYTES = 16_000_000  # most of the messages of a topic that stay however old they are


class Part(Enum):
    """What a topic is of: where its messages begin in a file."""

    DEPTH = "depth"  # at the first frame
    PICTURE = "picture"  # with what is stamped a little before it
    MOTION = "motion"  # earlier
    DECISION = "decision"  # earlier


@dataclass(frozen=True, slots=True)
class Source:
    """A topic by its full name, its type (`sensor_msgs/msg/Image`), and how many messages stay however old they are."""

    topic: str
    msgtype: str
    part: Part
    latched: int = 0


@dataclass(frozen=True, slots=True)
class Kept:
    """One message: its bytes, and the time of the stream in ns at which it came, by the stamps of the pictures."""

    source: Source
    cdr: bytes
    at_ns: int
    stamp_ns: int | None


class Recent:
    """Keeps what came last. ``seconds``: those of a file; ``most_bytes``: of all that is kept.

    What is latched stays in addition, as many messages of its topic as the source says.
    """

    def __init__(self, seconds: float, most_bytes: int) -> None:
        self._keep_ns, self._most_bytes = round(1e9 * SPARE * seconds), most_bytes
        self._seconds_ns = round(1e9 * seconds)
        self._messages: deque[Kept] = deque()
        self._latched: dict[str, deque[Kept]] = {}
        self._keyframes: deque[int] = deque()
        self._early: deque[tuple[Source, bytes, int | None]] = deque()  # before the first stamp
        self._early_nbytes = 0
        self.nbytes = 0
        self.clock_ns: int | None = None
        self.jumps = 0

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def span_s(self) -> float:
        """The seconds of what is kept; 0 of nothing."""
        return 0.0 if not self._messages else 1e-9 * (self._messages[-1].at_ns - self._messages[0].at_ns)

    def add(self, source: Source, cdr: bytes, stamp_ns: int | None, leads: bool = False) -> None:
        """Take in a message. One that ``leads`` moves the time of the stream to its stamp; back by a jump forgets."""
        if leads and stamp_ns is not None:
            self._go_to(stamp_ns)
        if self.clock_ns is None:
            self._wait(source, cdr, stamp_ns)
            return
        while self._early:
            self._take(*self._early.popleft())
        self._early_nbytes = 0
        self._take(source, cdr, stamp_ns)

    def _wait(self, source: Source, cdr: bytes, stamp_ns: int | None) -> None:
        """Keep a message until there is a stamp; pictures without any may come for ever."""
        self._early.append((source, cdr, stamp_ns))
        self._early_nbytes += len(cdr) + OVERHEAD
        while self._early and (len(self._early) > MOST_EARLY or self._early_nbytes > self._most_bytes):
            self._early_nbytes -= len(self._early.popleft()[1]) + OVERHEAD

    def _take(self, source: Source, cdr: bytes, stamp_ns: int | None) -> None:
        assert self.clock_ns is not None
        kept = Kept(source, cdr, self.clock_ns, stamp_ns)
        if source.latched:
            self._keep_latched(kept)
        self._messages.append(kept)
        self.nbytes += _size(kept)
        self._prune()

    def keep(self, source: Source, cdr: bytes) -> None:
        """Take in what its publisher keeps for who comes late: it is latched, and no message of now."""
        self._keep_latched(Kept(source, cdr, self.clock_ns or 0, None))

    def begin_keyframe(self, stamp_ns: int) -> None:
        """A keyframe begins at this stamp; a file may begin there."""
        if self.clock_ns is not None and stamp_ns <= self.clock_ns:
            self._keyframes.append(stamp_ns)

    def _go_to(self, stamp_ns: int) -> None:
        if self.clock_ns is not None and stamp_ns <= self.clock_ns - JUMP_NS:
            self.jumps += 1
            self._messages.clear()
            self._keyframes.clear()
            self.nbytes, self.clock_ns = 0, stamp_ns
        self.clock_ns = stamp_ns if self.clock_ns is None else max(self.clock_ns, stamp_ns)

    def _keep_latched(self, kept: Kept) -> None:
        queue = self._latched.setdefault(kept.source.topic, deque(maxlen=kept.source.latched))
        if not any(other.cdr == kept.cdr for other in queue):
            queue.append(kept)
            while len(queue) > 1 and sum(map(_size, queue)) > KEPT_BYTES:
                queue.popleft()

    def _prune(self) -> None:
        assert self.clock_ns is not None
        while self._messages and (
            self._messages[0].at_ns < self.clock_ns - self._keep_ns or self.nbytes > self._most_bytes
        ):
            self.nbytes -= _size(self._messages.popleft())
        while len(self._keyframes) > 1 and self._keyframes[1] <= self.clock_ns - self._keep_ns:
            self._keyframes.popleft()

    def begin_ns(self) -> int | None:
        """The stamp at which a file of now begins; None while nothing is kept.

        That of the last keyframe that began before its seconds, where that is still kept: a run on the file then ends
        its keyframes where the live one did.
        """
        if self.clock_ns is None or not self._messages:
            return None
        wanted, first = self.clock_ns - self._seconds_ns, self._messages[0].at_ns
        starts = [stamp for stamp in self._keyframes if first <= stamp <= wanted]
        return max([first, *(starts or [wanted])]) if wanted > first or starts else first

    def snapshot(self) -> list[Kept]:
        """What a file of now holds, in the order in which it came: first what is latched and older, then the rest.

        Their times never go back. Empty while nothing is kept. No byte is copied.
        """
        begin_ns = self.begin_ns()
        if begin_ns is None:
            return []
        chosen = [kept for kept in self._messages if _is_in(kept, begin_ns)]
        first_ns = chosen[0].at_ns if chosen else begin_ns
        there = {id(kept.cdr) for kept in chosen}
        older = [kept for queue in self._latched.values() for kept in queue if id(kept.cdr) not in there]
        return [*(replace(kept, at_ns=first_ns) for kept in older), *chosen]


def _is_in(kept: Kept, begin_ns: int) -> bool:
    """Whether a message is of a file that begins at a stamp: pictures by their own stamp, the rest by when it came."""
    if kept.source.part in (Part.MOTION, Part.DECISION):
        return kept.at_ns >= begin_ns - BEFORE_NS
    stamp_ns = kept.at_ns if kept.stamp_ns is None else kept.stamp_ns
    return stamp_ns >= begin_ns - (EARLIER_NS if kept.source.part is Part.PICTURE else 0)


def _size(kept: Kept) -> int:
    return len(kept.cdr) + OVERHEAD


def sources_of(messages: Iterable[Kept]) -> list[Source]:
    """The topics of messages, each once, in the order of their first ones."""
    return list(dict.fromkeys(kept.source for kept in messages))


def times_of(messages: Sequence[Kept]) -> list[int]:
    """A time in ns for each message, later than that of the one before: readers sort by it, and keep the order."""
    times, last = list[int](), -1
    for kept in messages:
        last = max(kept.at_ns, last + 1)
        times.append(last)
    return times
