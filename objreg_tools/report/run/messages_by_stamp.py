# SPDX-License-Identifier: Apache-2.0
"""The messages of a recording by the stamps of their headers, whenever they were recorded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from objreg_ros.bridge.messages import camera_from_msg, headers
from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_tools.recording.record import Record, Recording
from objreg_tools.recording.rosbag.messages import header_stamp_ns

SLOP_NS = 50_000_000  # how far from a time the stamp of its message may be
WINDOW_NS = 150_000_000  # how far from its stamp a message is looked for before all of its topic are read


class MessagesByStamp:
    """The messages of one topic; ``unreadable`` counts those that were met and whose stamp cannot be read."""

    def __init__(self, recording: Recording, topic: str) -> None:
        self.topic = topic
        self._recording = recording
        self._index: Array | None = None  # (N, 2): stamps, rising, and when they were recorded
        self._unreadable: set[int] = set()

    @property
    def unreadable(self) -> int:
        """How many messages were passed over so far."""
        return len(self._unreadable)

    def nearest(self, stamp_ns: int) -> Any | None:
        """The message with the stamp nearest to a time; None where none is within `SLOP_NS`.

        ValueError or OSError where it is broken.
        """
        near = dict(self._stamped(stamp_ns - WINDOW_NS, stamp_ns + WINDOW_NS))
        best = _nearest(near, stamp_ns)
        if best is None or not min(near) <= stamp_ns <= max(near):  # a nearer one may have been recorded at any time
            near = self._indexed(stamp_ns)
            best = _nearest(near, stamp_ns)
        return None if best is None else near[best].message

    def _indexed(self, stamp_ns: int) -> dict[int, Record]:
        """The records with the stamp that is nearest of all."""
        if self._index is None:
            stamps = sorted((stamp, record.stamp_ns) for stamp, record in self._stamped())
            self._index = np.array(stamps, np.int64).reshape(-1, 2)
        if len(self._index) == 0:
            return {}
        recorded_ns = int(self._index[np.abs(self._index[:, 0] - stamp_ns).argmin(), 1])
        return dict(self._stamped(recorded_ns, recorded_ns + 1))

    def _stamped(self, start_ns: int | None = None, end_ns: int | None = None) -> Iterator[tuple[int, Record]]:
        """The stamp of every message that was recorded in a time, with its record, up to where the file is broken."""
        records = self._recording.records([self.topic], start_ns, end_ns)
        while True:
            try:
                record = next(records, None)
            except ValueError:
                return
            if record is None:
                return
            try:
                stamp_ns = header_stamp_ns(record.cdr)
            except (ValueError, OSError):
                self._unreadable.add(record.stamp_ns)
                continue
            yield stamp_ns, record


def _nearest(stamps_ns: Iterable[int], stamp_ns: int) -> int | None:
    """The stamp within `SLOP_NS` that is nearest; None if there is none."""
    near = [stamp for stamp in stamps_ns if abs(stamp - stamp_ns) <= SLOP_NS]
    return min(near, key=lambda stamp: abs(stamp - stamp_ns), default=None)


class CamerasByStamp:
    """The calibrated camera_infos of a topic, without those that repeat the one before them."""

    def __init__(self, recording: Recording, topic: str | None) -> None:
        self._infos: list[tuple[int, Any]] = []
        last: Intrinsics | None = None
        for message in _readable(recording, topic) if topic else ():
            camera = _calibrated(message)
            if camera is not None and camera != last:
                self._infos.append((headers.stamp_ns(message), message))
                last = camera

    def at(self, stamp_ns: int) -> Any | None:
        """The newest camera_info at a time or before it, else the first; None where none is calibrated."""
        before = [(stamp, k) for k, (stamp, _) in enumerate(self._infos) if stamp <= stamp_ns]
        if before:
            return self._infos[max(before)[1]][1]
        return self._infos[0][1] if self._infos else None


def _readable(recording: Recording, topic: str) -> Iterator[Any]:
    """The messages of a topic that decode, up to where the file is broken."""
    try:
        yield from (message for record in recording.records([topic]) if (message := record.read()) is not None)
    except ValueError:
        return


def _calibrated(message: Any) -> Intrinsics | None:
    try:
        return camera_from_msg.intrinsics(message)
    except ValueError:
        return None
