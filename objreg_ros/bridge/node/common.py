# SPDX-License-Identifier: Apache-2.0
"""What nodes report in common: the counters of every node, and of one with several streams. Knows no ROS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.diagnostics import Diagnostics, family, reading

# What stands before the names of families that are also read: here, and by tests and tools.
DROPPED, LOST, CONNECTED = "dropped: ", "lost in transport: ", "connected: "
LATENCY, MALFORMED, FOUND = "latency ", "malformed ", "found: "


@dataclass(frozen=True, kw_only=True)
class CommonDiagnostics(Diagnostics):
    """What every node reports: received = published + waiting + all dropped."""

    received: int = reading(
        "received", "What came in: pictures, frames, keyframes or constraints, as the node counts.", "frames"
    )
    published: int = reading("published", "Those of them whose work was done.", "frames")
    waiting: int = reading("waiting", "Those of them that have not ended.", "frames")
    dropped: Mapping[str, int] = family(
        f"{DROPPED}<reason>",
        "Those of them that ended without, by [reason](wire.md#why-a-frame-or-a-constraint-is-dropped).",
        "frames",
    )
    lost: Mapping[str, int] = family(
        f"{LOST}<topic>", "What was sent on a topic and never came, by the gaps in the publisher's numbers.", "messages"
    )
    rate: float = reading("rate [Hz]", "What came in each second since the last report.", "Hz", "{:.2f}")
    median_ms: Mapping[str, float] = family(
        f"{LATENCY}<stage> p50 [ms]",
        "The median time that a stage takes of a frame that went out; `total` is from arrival until a frame's own work "
        "is done, `keyframe` from there until the keyframe that it completed is done: `wait`, `search`, `keep` and "
        "`pack` are part of that, where there is one, and all others of `total`.",
        "ms",
        "{:.2f}",
    )
    p95_ms: Mapping[str, float] = family(
        f"{LATENCY}<stage> p95 [ms]", "The 95th percentile of the same times, of the last thousand.", "ms", "{:.2f}"
    )
    state: str | None = reading("state", "Where a managed node is in its life cycle; absent of others.", default=None)
    connected: Mapping[str, int] = family(f"{CONNECTED}<topic>", "Those that an input is connected to.", "publishers")
    malformed: Mapping[str, int] = family(
        f"{MALFORMED}<input>",
        "Messages that are no frame by themselves and broke their contract; behind the input the exception, if it was "
        "a bug.",
        "messages",
    )
    found: Mapping[str, str] = family(
        f"{FOUND}<anchor>",
        "What [does not fit](troubleshooting.md#streams-that-are-not-what-they-say) in the stream of a registrar or "
        "keyframer, or in the map of a mapper: what was measured, the cause, what to do. The level is WARN while there "
        "is one, and the key goes when it fits again.",
    )

    @classmethod
    def of(cls, balance: Balance, rate_hz: float, **others: Any) -> Self:
        """The counters of a node as what it reports, with ``others`` of the fields."""
        return cls(
            received=balance.received,
            published=balance.published,
            waiting=balance.waiting,
            dropped=balance.dropped,
            lost=balance.lost,
            rate=rate_hz,
            median_ms={stage: median for stage, (median, _) in balance.stage_ms.items()},
            p95_ms={stage: p95 for stage, (_, p95) in balance.stage_ms.items()},
            **others,
        )


@dataclass(frozen=True, kw_only=True)
class StreamDiagnostics(Diagnostics):
    """What a node reports of the streams that its frames are matched with."""

    received: Mapping[str, int] = family("<stream> received", "Messages of a stream that frames are matched with.",
                                         "messages")  # fmt: skip
    unused: Mapping[tuple[str, str], int] = family(
        "<stream> <reason>",
        "Those of them that met no frame, by [reason](wire.md#why-a-frame-or-a-constraint-is-dropped).",
        "messages",
    )
