# SPDX-License-Identifier: Apache-2.0
"""Every metric, declared once: its name, what it means, its labels, and what it reads of an observation.

Names and units follow the rules of Prometheus. The counters are those of the nodes, which begin at 0 with each: nothing
is missed where this command starts later. Knows no ROS.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from objreg_tools.cli.metrics.observed import Observation

Sample = tuple[tuple[str, ...], float]  # the values of the labels behind `node`, and the number


@dataclass(frozen=True, slots=True)
class Family:
    """One metric. ``samples`` gives its numbers for one node: none where the node does not report it.

    A gauge of a node that is silent is left out, unless it ``outlasts`` the node: it would stand still.
    """

    name: str
    doc: str
    samples: Callable[[Observation], Iterable[Sample]]
    labels: tuple[str, ...] = ()
    outlasts: bool = False

    @property
    def is_counter(self) -> bool:
        """Whether it only grows, until its node begins anew."""
        return self.name.endswith("_total")

    @property
    def unit(self) -> str:
        """The unit, by the end of the name; empty for a count."""
        return "seconds" if self.name.endswith("_seconds") else ""

    def of(self, node: Observation) -> Iterator[Sample]:
        """The samples that are current."""
        if self.is_counter or self.outlasts or not node.report.is_silent():
            yield from self.samples(node)


def _one(number: float | None) -> list[Sample]:
    return [] if number is None else [((), number)]


def _each(numbers: Mapping[str, int]) -> list[Sample]:
    return [((name,), number) for name, number in sorted(numbers.items())]


def _latency(node: Observation, column: int) -> list[Sample]:
    stages = sorted(node.report.balance.stage_ms.items())
    return [((stage,), times[column] / 1e3) for stage, times in stages]


FAMILIES = (
    Family(
        "objreg_node_up",
        "1 while a node reports on /diagnostics, 0 once it has been silent for 5 s.",
        lambda node: _one(not node.report.is_silent()),
        outlasts=True,
    ),
    Family(
        "objreg_node_warns",
        "1 while a node reports trouble of any kind, 0 while it does not.",
        lambda node: _one(node.report.warns),
    ),
    Family(
        "objreg_stream_doubted",
        "1 while a node finds that its stream, or a mapper its map, is not what it states; 0 while it does not.",
        lambda node: _one(bool(node.report.found)),
    ),
    Family(
        "objreg_stream_finding",
        "1 for each thing that does not fit, by its heading in docs/troubleshooting.md; absent when it fits again.",
        lambda node: [((anchor,), 1) for anchor in node.report.found],
        ("finding",),
    ),
    Family("objreg_closures_total", "Loop closures that were published.", lambda node: _one(node.closures)),
    Family(
        "objreg_refusals_total",
        "Loop closures that were refused, by reason.",
        lambda node: _each(node.report.rejected),
        ("reason",),
    ),
    Family(
        "objreg_since_last_closure_seconds",
        "Seconds since the last loop closure, as seen within a second; absent before the first that was seen.",
        lambda node: _one(node.since_closure_s()),
    ),
    Family(
        "objreg_frames_received_total",
        "What came in: pictures, frames, keyframes or constraints, as the node counts.",
        lambda node: _one(node.report.balance.received),
    ),
    Family(
        "objreg_frames_published_total",
        "Frames whose work was done.",
        lambda node: _one(node.report.balance.published),
    ),
    Family(
        "objreg_frames_dropped_total",
        "Frames that ended without, by reason.",
        lambda node: _each(node.report.balance.dropped),
        ("reason",),
    ),
    Family(
        "objreg_frames_waiting",
        "Frames that have not ended.",
        lambda node: _one(node.report.balance.waiting),
    ),
    Family(
        "objreg_messages_lost_total",
        "Messages that were sent on a topic and never came.",
        lambda node: _each(node.report.balance.lost),
        ("topic",),
    ),
    Family(
        "objreg_latency_p50_seconds",
        "The median time that a stage takes of a frame, of the last thousand; the stage total is the whole frame.",
        lambda node: _latency(node, 0),
        ("stage",),
    ),
    Family(
        "objreg_latency_p95_seconds",
        "The 95th percentile of the same times.",
        lambda node: _latency(node, 1),
        ("stage",),
    ),
)
