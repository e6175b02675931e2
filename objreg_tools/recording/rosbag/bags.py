# SPDX-License-Identifier: Apache-2.0
"""rosbag1 and rosbag2, plain and compressed, read through the library `rosbags`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import reader as rosbag2
from rosbags.typesys.store import Typestore

from objreg_tools.recording.record import Record, Recording, Topic
from objreg_tools.recording.rosbag.bag_errors import (
    UNINDEXED,
    broken_bag,
    broken_means_value_error,
    is_whole_mcap,
    odd_message,
    said,
    says_broken,
)
from objreg_tools.recording.rosbag.bag_files import open_bag
from objreg_tools.recording.rosbag.messages import READ, difference, misfit, serialise, standard_types
from objreg_tools.recording.rosbag.unpacking import ZSTD_MAGIC, bound_unpacking
from objreg_tools.recording.rosbag.vision_types import define_vision

END_OF_TIME_NS = 2**63
UNDEFINED = (
    "{}: {}: expected the definition of {} in the bag, got none; `ros2 bag convert` it to mcap where its package is "
    "installed"
)
ASSUMED = "the bag does not define {}: read as vision_msgs of version 3 or 4 has it"

bound_unpacking()


class BagRecording(Recording):
    """A rosbag1 file, a rosbag2 folder, a single file of one, or the files of a folder without metadata.yaml."""

    def __init__(self, path: Path) -> None:
        self.path = path
        bag = open_bag(path)
        self._reader, self._kept, self._files = bag.reader, bag.kept, bag.files
        self.kind = _kind(bag.files)
        self._connections, notes = _one_type_each(self._reader.connections)
        self.notes = [*bag.notes, *notes, *self._define()]
        self.topics = _topics(self._connections)
        found = {kind: misfit(kind, self._types()) for kind in READ if kind in self._types().fielddefs}
        self._misfits = {kind: why for kind, why in found.items() if why}
        spans = any(topic.count for topic in self.topics.values())
        self.start_ns, self.end_ns = (self._reader.start_time, self._reader.end_time) if spans else (0, 0)
        if not -END_OF_TIME_NS <= self.start_ns <= self.end_ns <= END_OF_TIME_NS:
            self.close()
            got = f"records from {self.start_ns} to {self.end_ns} ns"
            raise ValueError(f"{path}: expected a whole bag, got: {got}; {UNINDEXED}")

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """See `Recording.records`. ValueError at the place where the file is broken."""
        wanted = [c for c in self._connections if topics is None or c.topic in topics]
        if not wanted:
            return
        with broken_means_value_error(self.path, opened=True):
            for connection, stamp_ns, raw in self._reader.messages(wanted, start_ns, end_ns):
                yield self._record(connection, stamp_ns, raw)

    def offered_qos(self) -> dict[str, list[Qos]]:
        """See `Recording.offered_qos`. What was latched in ROS 1 is transient local, as deep as it had publishers."""
        offers: dict[str, list[Qos]] = {}
        for connection in self._connections:
            if isinstance(connection.ext, ConnectionExtRosbag2):
                offers.setdefault(connection.topic, []).extend(connection.ext.offered_qos_profiles)
        latched = Counter(c.topic for c in self._connections if _is_latched(c))
        offers.update({topic: [latched_qos(count)] for topic, count in latched.items()})
        return {topic: profiles for topic, profiles in offers.items() if profiles}

    def _obstacle(self, msgtype: str, shipped_only: bool) -> str:
        """The bytes of a rosbag2 are passed on as they are, so the fields have to be the same."""
        if not self._reader.is2:
            return super()._obstacle(msgtype, shipped_only)
        passes = not shipped_only and msgtype not in standard_types().fielddefs
        return "" if passes else difference(msgtype, self._types())

    def _define(self) -> list[str]:
        """Take definitions of ours for what a rosbag2 does not define, and a note on that."""
        used = (connection.msgtype for connection in self._connections)
        taken = define_vision(self._types(), used) if self._reader.is2 else []
        return [ASSUMED.format(", ".join(taken))] if taken else []

    def _types(self) -> Typestore:
        return self._reader.typestore

    def close(self) -> None:
        """Close the files."""
        self._reader.close()
        self._kept.close()

    def _unpacked(self, raw: bytes) -> bytes:
        """The bytes of a message that was packed by itself, which only metadata.yaml states; CDR begins with 0."""
        return rosbag2.zstd.decompress(raw) if self._reader.is2 and raw[:4] == ZSTD_MAGIC else raw

    def _odd_message(self, got: str) -> ValueError:
        return odd_message(self.path, got) if self._is_whole else broken_bag(self.path, got, opened=True)

    @cached_property
    def _is_whole(self) -> bool:
        return all(map(is_whole_mcap, self._files))

    def _record(self, connection: Any, stamp_ns: int, raw: bytes) -> Record:
        def decode() -> Any:
            if connection.msgtype in self._misfits:
                raise self._odd_message(self._misfits[connection.msgtype])
            if connection.msgtype not in self._types().fielddefs:
                raise ValueError(UNDEFINED.format(self.path, connection.topic, connection.msgtype))
            try:
                return self._reader.deserialize(self._unpacked(raw), connection.msgtype)
            except Exception as error:
                if not says_broken(error):
                    raise
                raise self._odd_message(f"{connection.topic}: {said(error)}") from error

        def encode() -> bytes:
            if not self._reader.is2:
                return serialise(decode())
            with broken_means_value_error(self.path, opened=True):
                return bytes(self._unpacked(raw))

        return Record(connection.topic, connection.msgtype, stamp_ns, decode, encode)


def latched_qos(depth: int) -> Qos:
    """The last ``depth`` messages are kept for who comes late, as ROS 1 does with what is latched."""
    default = QosTime(0, 0)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=depth,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL,
        deadline=default,
        lifespan=default,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=default,
        avoid_ros_namespace_conventions=False,
    )


def _is_latched(connection: Connection) -> bool:
    return isinstance(connection.ext, ConnectionExtRosbag1) and bool(connection.ext.latching)


def _one_type_each(connections: Iterable[Connection]) -> tuple[list[Connection], list[str]]:
    """The connections without those of a topic's rarer types, of which ROS 2 allows one, and a note on each of these.

    Of types that are as frequent the first is kept.
    """
    counts: dict[str, Counter[str]] = {}
    for connection in connections:
        counts.setdefault(connection.topic, Counter())[connection.msgtype] += connection.msgcount
    chosen = {topic: kinds.most_common(1)[0][0] for topic, kinds in counts.items()}
    notes = [
        f"{topic} is {chosen[topic]} and also {kind}: its {count} messages of that type are left out"
        for topic, kinds in counts.items()
        for kind, count in kinds.items()
        if kind != chosen[topic]
    ]
    return [connection for connection in connections if connection.msgtype == chosen[connection.topic]], notes


def _topics(connections: Iterable[Connection]) -> dict[str, Topic]:
    counts: dict[str, Topic] = {}
    for connection in connections:
        before = counts[connection.topic].count if connection.topic in counts else 0
        counts[connection.topic] = Topic(connection.topic, connection.msgtype, before + connection.msgcount)
    return dict(sorted(counts.items()))


def _kind(files: Sequence[Path]) -> str:
    if any(file.suffix == ".bag" for file in files):
        return "rosbag1"
    return "rosbag2 (mcap)" if any(".mcap" in file.suffixes for file in files) else "rosbag2 (sqlite3)"
