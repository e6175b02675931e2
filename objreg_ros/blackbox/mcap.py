# SPDX-License-Identifier: Apache-2.0
"""Writes messages that are bytes already as one MCAP file (https://mcap.dev/spec), uncompressed and with its index.

A robot needs no library for it. `objreg`, `ros2 bag` and Foxglove read it.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, DATA_END = 0x0B, 0x0F
CHUNK_BYTES = 4_000_000
LIBRARY = "objreg_ros"
FOREVER = "{{sec: 9223372036, nsec: 854775807}}"  # with its braces doubled, for `str.format`
LATCHED = (
    "- {{history: keep_last, depth: {depth}, reliability: reliable, durability: transient_local, "
    f"deadline: {FOREVER}, lifespan: {FOREVER}, liveliness: automatic, liveliness_lease_duration: {FOREVER}, "
    "avoid_ros_namespace_conventions: false}}"
)


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of the file: name, type, definition of the type, and how many messages of it are latched (0: none)."""

    name: str
    msgtype: str
    definition: str
    latched: int = 0


@dataclass(slots=True)
class _Chunk:
    """What was gathered of one chunk, and where its messages lie in it, by channel."""

    data: bytearray = field(default_factory=bytearray)
    places: dict[int, list[tuple[int, int]]] = field(default_factory=dict)


def write_mcap(file: BinaryIO, topics: Sequence[Topic], messages: Iterable[tuple[int, int, bytes]]) -> int:
    """Write messages, each the number of its topic, its time in ns and its bytes, in order of time; how many there are.

    OSError where the file takes no more.
    """
    writer = _Writer(file)
    head = b"".join(_channels(topics))
    writer.write(MAGIC + _record(HEADER, _text("ros2") + _text(LIBRARY)))
    chunk = _Chunk(bytearray(head))
    for number, time_ns, cdr in messages:
        writer.gather(chunk, number + 1, time_ns, cdr)
        if len(chunk.data) >= CHUNK_BYTES:
            writer.end_chunk(chunk)
            chunk = _Chunk()
    writer.end_chunk(chunk)
    writer.end(head, len(topics), len({topic.msgtype for topic in topics}))
    return writer.counts.total()


class _Writer:
    def __init__(self, file: BinaryIO) -> None:
        self._file, self._place = file, 0
        self._chunks: list[bytes] = []
        self._first_ns, self._last_ns = 0, 0
        self.counts = Counter[int]()

    def write(self, data: bytes | bytearray) -> None:
        self._file.write(data)
        self._place += len(data)

    def gather(self, chunk: _Chunk, channel: int, time_ns: int, cdr: bytes) -> None:
        chunk.places.setdefault(channel, []).append((time_ns, len(chunk.data)))
        head = struct.pack("<HIQQ", channel, self.counts[channel] & 0xFFFFFFFF, time_ns, time_ns)
        chunk.data += struct.pack("<BQ", MESSAGE, len(head) + len(cdr)) + head
        chunk.data += cdr
        self._first_ns = self._first_ns if self.counts else time_ns
        self._last_ns = time_ns
        self.counts[channel] += 1

    def end_chunk(self, chunk: _Chunk) -> None:
        """Write what was gathered, and the index behind it; nothing where there is nothing."""
        if not chunk.data:
            return
        times = [time_ns for places in chunk.places.values() for time_ns, _ in places] or [0]
        span, size = struct.pack("<QQ", min(times), max(times)), len(chunk.data)
        head = span + struct.pack("<QI", size, zlib.crc32(chunk.data)) + _text("") + struct.pack("<Q", size)
        begin = self._place
        self.write(struct.pack("<BQ", CHUNK, len(head) + size) + head)
        self.write(chunk.data)
        length, offsets = self._place - begin, {}
        for channel, places in chunk.places.items():
            offsets[channel] = self._place
            listed = b"".join(struct.pack("<QQ", *place) for place in places)
            self.write(_record(INDEX, struct.pack("<HI", channel, len(listed)) + listed))
        listed = b"".join(struct.pack("<HQ", *pair) for pair in offsets.items())
        indexed = self._place - begin - length
        self._chunks.append(
            span
            + struct.pack("<QQI", begin, length, len(listed))
            + listed
            + struct.pack("<Q", indexed)
            + _text("")
            + struct.pack("<QQ", size, size)
        )

    def end(self, head: bytes, channels: int, schemas: int) -> None:
        """Write the summary: schemas, channels, chunks and numbers."""
        self.write(_record(DATA_END, struct.pack("<I", 0)))
        begin = self._place
        counted = b"".join(struct.pack("<HQ", *pair) for pair in sorted(self.counts.items()))
        numbers = (self.counts.total(), schemas, channels, 0, 0, len(self._chunks), self._first_ns, self._last_ns)
        statistics = struct.pack("<QHIIIIQQ", *numbers) + struct.pack("<I", len(counted)) + counted
        self.write(head + b"".join(_record(CHUNK_INDEX, chunk) for chunk in self._chunks))
        self.write(_record(STATISTICS, statistics))
        self.write(_record(FOOTER, struct.pack("<QQI", begin, 0, 0)) + MAGIC)


def _channels(topics: Sequence[Topic]) -> Iterable[bytes]:
    """A schema for each type and a channel for each topic; their numbers begin with 1."""
    schemas = {msgtype: number for number, msgtype in enumerate(dict.fromkeys(t.msgtype for t in topics), start=1)}
    texts = {topic.msgtype: topic.definition for topic in topics}
    for msgtype, number in schemas.items():
        body = struct.pack("<H", number) + _text(msgtype) + _text("ros2msg") + _text(texts[msgtype])
        yield _record(SCHEMA, body)
    for number, topic in enumerate(topics, start=1):
        ids = struct.pack("<HH", number, schemas[topic.msgtype])
        qos = {"offered_qos_profiles": LATCHED.format(depth=topic.latched)} if topic.latched else {}
        yield _record(CHANNEL, ids + _text(topic.name) + _text("cdr") + _map(qos))


def _record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _map(values: Mapping[str, str]) -> bytes:
    data = b"".join(_text(key) + _text(value) for key, value in values.items())
    return struct.pack("<I", len(data)) + data
