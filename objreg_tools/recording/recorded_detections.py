# SPDX-License-Identifier: Apache-2.0
"""Detections of another detector that were recorded with the pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from objreg_tools.recording.record import Recording, Topic
from objreg_tools.recording.topic_rules import OWN, fits

BOXES, MASKS, NAMES = "vision_msgs/msg/Detection2DArray", "sensor_msgs/msg/Image", "vision_msgs/msg/LabelInfo"
MASK = r"(^|[/_])(masks?|instances?|instance_\w+)([/_]|$)"  # in a name: a picture of anything else is no mask


@dataclass(frozen=True, slots=True)
class RecordedDetections:
    """The topic of boxes or of masks, and that of the names of their numbers, where there is one."""

    topic: str
    names: str | None = None

    @property
    def topics(self) -> dict[str, str]:
        """Topic → what `objreg_tools.offline` takes it as."""
        return {self.topic: "detections", **({self.names: "label_info"} if self.names else {})}


def recorded_detections(topics: Mapping[str, Topic]) -> list[RecordedDetections]:
    """The topics of detections in a recording: boxes before masks, then by name."""
    there = [topics[name] for name in sorted(topics) if topics[name].count and not OWN.search(name)]
    found = [t.name for t in there if t.msgtype == BOXES]
    found += [t.name for t in there if t.msgtype == MASKS and fits(MASK, t.name)]
    return [RecordedDetections(name, _names_of(name, topics)) for name in found]


def choose_detections(recording: Recording, name: str) -> RecordedDetections:
    """The detections of a topic that the user names.

    ValueError for one that is not there, holds something else, or whose first message cannot be read.
    """
    topics = recording.topics
    there = ", ".join(one.topic for one in recorded_detections(topics)) or "none"
    if name not in topics or not topics[name].count:
        raise ValueError(f"--detections: expected a topic of the recording (of detections: {there}), got {name!r}")
    if topics[name].msgtype not in (BOXES, MASKS):
        expected = f"{BOXES} or masks as {MASKS} (there: {there})"
        raise ValueError(f"--detections: expected {expected}, got {name} ({topics[name].msgtype})")
    _ = next(recording.records([name])).message  # its ValueError says why it cannot be read
    return RecordedDetections(name, _names_of(name, topics))


def _names_of(name: str, topics: Mapping[str, Topic]) -> str | None:
    """The names that share most folders with a topic; None where the recording has none."""
    named = [topic.name for topic in topics.values() if topic.msgtype == NAMES and topic.count]
    return max(named, key=lambda one: (_shared(one, name), -len(one)), default=None)


def _shared(one: str, other: str) -> int:
    pairs = list(zip(one.strip("/").split("/"), other.strip("/").split("/"), strict=False))
    return next((count for count, (a, b) in enumerate(pairs) if a != b), len(pairs))
