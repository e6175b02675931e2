# SPDX-License-Identifier: Apache-2.0
"""A link that is slow, late and loses frames, and the relay that carries Ethernet frames between hosts over such links.

Every host sends over a link of its own. A frame waits until those before it are sent, as long as the queue has room,
takes its time at the link's rate, is lost or not, and arrives after the delay. A pause loses all that is sent in it,
and all that is sent to the host.
"""

from __future__ import annotations

import heapq
import itertools
import math
import os
import random
import select
import threading
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

LONGEST_FRAME = 65_536  # bytes
LONGEST_WAIT_S = 0.05  # after which the relay looks whether it has ended
ADDRESS = 6  # bytes of an Ethernet address; a frame begins with that of its receiver, then that of its sender


@dataclass(frozen=True)
class Conditions:
    """How bad a link is: ``loss`` is a probability per frame, the queue holds what waits to be sent."""

    loss: float = 0.0
    delay_s: float = 0.0
    bits_per_second: float = math.inf
    queue_bytes: int = 1_500_000
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.loss <= 1.0:
            raise ValueError(f"expected a loss of 0 to 1, got {self.loss}")
        if not (self.delay_s >= 0.0 and self.bits_per_second > 0.0 and self.queue_bytes > 0):
            raise ValueError(f"expected a delay of 0 s or more, a rate and a queue above 0, got {self}")


class Link:
    """Decides of each frame when it arrives, or that it does not; ``counts`` has what became of them, by reason."""

    def __init__(self, conditions: Conditions, lane: int = 0) -> None:
        self._conditions = conditions
        self._random = random.Random(f"{conditions.seed} {lane}")
        self._free_s = -math.inf
        self._paused_until_s = -math.inf
        self.counts: Counter[str] = Counter()
        self.longest_bytes = 0

    def pause(self, until_s: float) -> None:
        self._paused_until_s = until_s

    def is_paused(self, now_s: float) -> bool:
        return now_s < self._paused_until_s

    def arrival_s(self, now_s: float, size: int) -> float | None:
        """When a frame of so many bytes that is sent now arrives; None where it is lost."""
        self.longest_bytes = max(self.longest_bytes, size)
        fate, arrival_s = self._send(now_s, size)
        self.counts[fate] += 1
        return arrival_s

    def _send(self, now_s: float, size: int) -> tuple[str, float | None]:
        if self.is_paused(now_s):
            return "paused", None
        rate = self._conditions.bits_per_second / 8
        start_s = max(now_s, self._free_s)
        if start_s > now_s and (start_s - now_s) * rate + size > self._conditions.queue_bytes:
            return "overflowed", None
        self._free_s = start_s + size / rate
        if self._random.random() < self._conditions.loss:
            return "lost", None
        return "carried", self._free_s + self._conditions.delay_s


class Switch:
    """Learns behind which port an address is, as an Ethernet switch does."""

    def __init__(self, ports: int) -> None:
        self._ports = ports
        self._behind: dict[bytes, int] = {}

    def targets(self, port: int, frame: bytes) -> list[int]:
        """The ports that a frame from ``port`` leaves by: one for a known address, else all others."""
        receiver, sender = frame[:ADDRESS], frame[ADDRESS : 2 * ADDRESS]
        self._behind[sender] = port
        if (known := self._behind.get(receiver)) is not None:
            return [known] if known != port else []
        return [other for other in range(self._ports) if other != port]


class Relay(threading.Thread):
    """Carries frames between file descriptors of which each read and write is one frame, until ``stop``."""

    def __init__(self, ports: Sequence[int], conditions: Conditions) -> None:
        super().__init__(name="relay", daemon=True)
        self.links = [Link(conditions, lane) for lane in range(len(ports))]
        self._ports = list(ports)
        self._switch = Switch(len(ports))
        self._under_way: list[tuple[float, int, int, bytes]] = []  # arrival, its number, port, frame
        self._numbers = itertools.count()
        self._ended = threading.Event()

    def pause(self, seconds: float, ports: Iterable[int] | None = None) -> None:
        """Nothing comes or goes by these ports for so long, by any where None."""
        for port in range(len(self.links)) if ports is None else ports:
            self.links[port].pause(time.monotonic() + seconds)

    def stop(self) -> None:
        self._ended.set()
        self.join()

    def run(self) -> None:
        while not self._ended.is_set():
            wait_s = self._under_way[0][0] - time.monotonic() if self._under_way else LONGEST_WAIT_S
            for fd in select.select(self._ports, [], [], min(max(wait_s, 0.0), LONGEST_WAIT_S))[0]:
                self._take(self._ports.index(fd), os.read(fd, LONGEST_FRAME))
            self._deliver(time.monotonic())

    def _take(self, port: int, frame: bytes) -> None:
        now_s = time.monotonic()
        arrival_s = self.links[port].arrival_s(now_s, len(frame))
        if arrival_s is not None:
            for target in self._switch.targets(port, frame):
                if not self.links[target].is_paused(now_s):
                    heapq.heappush(self._under_way, (arrival_s, next(self._numbers), target, frame))

    def _deliver(self, now_s: float) -> None:
        while self._under_way and self._under_way[0][0] <= now_s:
            _, _, port, frame = heapq.heappop(self._under_way)
            os.write(self._ports[port], frame)
