# SPDX-License-Identifier: Apache-2.0
"""The content of a replay: the topics of a recording, their names, and the first and last time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

from objreg_tools.recording.inputs import GRAPH_TOPICS, Inputs
from objreg_tools.recording.record import Record, Recording

Item = TypeVar("Item")

COMPRESSED = {"image": "image/compressed", "depth": "depth/image/compressedDepth"}
POSES = {
    "geometry_msgs/msg/PoseStamped": "odom/pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "odom/pose_with_covariance",
}
AHEAD = 30  # records that are read before they are due


@dataclass(frozen=True, slots=True)
class Selection:
    """The part to play: ``names`` gives the published name of each topic; times in seconds from the start."""

    names: dict[str, str]
    start: float = 0.0
    end: float | None = None

    def records(self, recording: Recording) -> Iterator[Record]:
        """The selected records, in order of time.

        They begin with what was latched before the start, as a subscriber that came then got it: with the time of the
        start, and with its own stamp in its header.
        """
        start_ns = recording.start_ns + round(self.start * 1e9)
        end_ns = None if self.end is None else recording.start_ns + round(self.end * 1e9)
        yield from self._latched(recording, start_ns)
        yield from recording.records(set(self.names), start_ns, end_ns)

    def _latched(self, recording: Recording, start_ns: int) -> list[Record]:
        """The last messages of each latched topic before a time, as many as were kept."""
        last = {topic: deque[Record](maxlen=depth) for topic, depth in recording.latched.items() if topic in self.names}
        for record in recording.records(set(last), end_ns=start_ns) if last else ():
            last[record.topic].append(replace(record, stamp_ns=start_ns))
        return [record for records in last.values() for record in records]

    def require_some(self, recording: Recording) -> None:
        """ValueError where the times leave nothing of the recording."""
        if self.start >= recording.seconds or (self.end is not None and self.end <= self.start):
            end = "the end" if self.end is None else f"{self.end:g} s"
            raise ValueError(
                f"expected a part of the {recording.seconds:.1f} s of the recording, got {self.start:g} s to {end}"
            )

    def count(self, recording: Recording) -> int:
        """About how many records these are: exact for the whole recording, else by share of time."""
        whole = sum(recording.topics[topic].count for topic in self.names)
        length = recording.seconds
        end = length if self.end is None else min(self.end, length)
        return whole if length == 0 else round(whole * max(0.0, min(1.0, (end - self.start) / length)))


def graph_names(recording: Recording, inputs: Inputs) -> dict[str, str]:
    """Each chosen input under the name that the nodes listen to."""
    return {topic: _graph_name(recording, name, topic) for name, topic in inputs.chosen().items()}


def _graph_name(recording: Recording, name: str, topic: str) -> str:
    kind = recording.topics[topic].msgtype
    if name == "odom":
        return POSES.get(kind, GRAPH_TOPICS[name])
    return COMPRESSED[name] if kind.endswith("CompressedImage") else GRAPH_TOPICS[name]


def recorded_names(recording: Recording) -> dict[str, str]:
    """Every topic under its own name."""
    return {topic: topic for topic in recording.topics}


def read_ahead(items: Iterable[Item], ahead: int = AHEAD) -> Iterator[Item]:
    """The same items, made in a thread of their own before they are wanted. What making them raises is raised here."""
    source = iter(items)
    reader = ThreadPoolExecutor(1, "read ahead")
    try:
        due = deque(reader.submit(next, source, None) for _ in range(ahead))
        while (item := due.popleft().result()) is not None:
            due.append(reader.submit(next, source, None))
            yield item
    finally:
        reader.shutdown(cancel_futures=True)
