# SPDX-License-Identifier: Apache-2.0
"""rosbag1 and rosbag2, plain and compressed, read through the library `rosbags`."""

from __future__ import annotations

import errno
import struct
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError
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
from rosbags.rosbag1 import ReaderError as Rosbag1Error
from rosbags.rosbag2 import ReaderError as Rosbag2Error
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from objreg_ros.recording.messages import READ, difference, misfit, serialise, standard_types
from objreg_ros.recording.record import Record, Recording, Topic
from objreg_ros.recording.text import SETTINGS_BYTES, require_regular
from objreg_ros.recording.unpacking import UnpackingError, bound_unpacking, require_room

METADATA = "metadata.yaml"
METADATA_BYTES = 16 * SETTINGS_BYTES  # it has a line for every file and every topic
END_OF_TIME_NS = 2**63

# What the library lets through when the bytes of a file are not what they should be.
BROKEN = (
    AnyReaderError,
    Rosbag1Error,
    Rosbag2Error,
    SerdeError,
    struct.error,
    AssertionError,
    EOFError,
    KeyError,
    IndexError,
    TypeError,
    ValueError,
    AttributeError,
    RuntimeError,  # lz4, and nested too deeply
    MemoryError,  # sizes that lie
    OverflowError,
)
# The packages whose own errors say the same, by name: which of them `rosbags` reads with hangs on its version.
DECODERS = {"apsw", "sqlite3", "backports", "compression", "zstandard"}
REPAIR = {
    ".bag": "`rosbag reindex` repairs a bag that was not closed",
    ".mcap": "`mcap recover` saves what is readable",
    ".db3": "`sqlite3 old.db3 .recover | sqlite3 new.db3` saves what is readable, `ros2 bag reindex` its metadata",
}

bound_unpacking()


class BagRecording(Recording):
    """A rosbag1 file, a rosbag2 folder or a single rosbag2 file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        _require_readable(path)
        with _broken_means_value_error(path):
            require_room(path)
            self._reader = AnyReader([path], default_typestore=standard_types())
            self._reader.open()
        self.kind = _kind(path)
        self._connections, self.notes = _one_type_each(self._reader.connections)
        self.topics = _topics(self._connections)
        told = {kind: misfit(kind, self._types()) for kind in READ if kind in self._types().fielddefs}
        self._misfits = {kind: why for kind, why in told.items() if why}
        spans = any(topic.count for topic in self.topics.values())
        self.start_ns, self.end_ns = (self._reader.start_time, self._reader.end_time) if spans else (0, 0)
        if not -END_OF_TIME_NS <= self.start_ns <= self.end_ns <= END_OF_TIME_NS:
            self.close()
            raise _broken_bag(path, f"records from {self.start_ns} to {self.end_ns} ns")

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """See `Recording.records`. ValueError at the place where the file is broken."""
        wanted = [c for c in self._connections if topics is None or c.topic in topics]
        if not wanted:
            return
        with _broken_means_value_error(self.path):
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

    def _types(self) -> Typestore:
        return self._reader.typestore

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    def _record(self, connection: Any, stamp_ns: int, raw: bytes) -> Record:
        def decode() -> Any:
            if connection.msgtype in self._misfits:
                raise _broken_bag(self.path, self._misfits[connection.msgtype])
            with _broken_means_value_error(self.path):
                return self._reader.deserialize(raw, connection.msgtype)

        def encode() -> bytes:
            return bytes(raw) if self._reader.is2 else serialise(decode())

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


def _kind(path: Path) -> str:
    if path.suffix == ".bag":
        return "rosbag1"
    files = [path] if path.is_file() else sorted(path.iterdir())
    return "rosbag2 (mcap)" if any(".mcap" in file.suffixes for file in files) else "rosbag2 (sqlite3)"


@contextmanager
def _broken_means_value_error(path: Path) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        if not _says_broken(error):
            raise
        if (denied := _denial(error)) is not None:
            raise PermissionError(f"{path}: expected permission to read it, got: {denied.strerror}") from error
        if isinstance(error, UnpackingError):
            raise ValueError(f"{path}: {error}") from error
        raise _broken_bag(path, _said(error)) from error


def _said(error: Exception) -> str:
    """An error in one line; with its name where it is none of those that were made to be read."""
    said, name = " ".join(str(error).split()).rstrip("."), type(error).__name__
    if not said or isinstance(error, (LookupError, MemoryError, OverflowError, RecursionError, AttributeError)):
        return f"{name}: {said}".rstrip(": ")
    return said


def _broken_bag(path: Path, got: str) -> ValueError:
    suffix = path.suffix if path.is_file() else next((f.suffix for f in path.iterdir() if f.suffix in REPAIR), "")
    repair = REPAIR.get(suffix, "record it again or check the copy")
    return ValueError(f"{path}: expected a whole bag, got: {got}; truncated or corrupt? {repair}")


def _require_readable(path: Path) -> None:
    """ValueError for what the library would wait for, or read, without end."""
    if not path.is_dir():
        require_regular(path)
        return
    for file in sorted(file for file in path.iterdir() if not file.is_dir() and file.exists()):
        size = require_regular(file)
        if file.name == METADATA and size > METADATA_BYTES:
            raise ValueError(f"{file}: expected at most {METADATA_BYTES} bytes of metadata, got {size}; reindex it")


def _denial(error: BaseException | None) -> PermissionError | None:
    """The refusal of the system that an error came of, if one did."""
    while error is not None and not isinstance(error, PermissionError):
        error = error.__cause__ or error.__context__
    return error


def _says_broken(error: Exception) -> bool:
    of_bz2 = type(error) is OSError and error.errno is None  # those of the system have a number
    beyond = isinstance(error, OSError) and error.errno == errno.EINVAL  # a place that no file has
    return isinstance(error, BROKEN) or of_bz2 or beyond or type(error).__module__.partition(".")[0] in DECODERS
