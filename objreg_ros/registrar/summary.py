# SPDX-License-Identifier: Apache-2.0
"""What registrars say to each other, as bytes: the summary of a keyframe, the request for it, and the keyframe itself.

Each is in an `envelope`: the objects' positions in float32 and descriptors in float16, or a packed keyframe, follow its
head.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.keyframes.frame_window import Clock
from objreg_ros.memory.compact import MOST_WHOLE, pack_keyframe, real, text, unpack_keyframe, whole, within
from objreg_ros.memory.descriptor import SIZE
from objreg_ros.memory.envelope import MOST_SAID, Head, by_zlib
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registration.keyframe import Keyframe

SUMMARY = by_zlib(b"OXS", "a summary", limits.MOST_SUMMARY, limits.MOST_UNPACKED_SUMMARY)
REQUEST = by_zlib(b"OXR", "a request", limits.MOST_SUMMARY, limits.MOST_UNPACKED_SUMMARY)
DELIVERY = by_zlib(b"OXD", "a delivery", limits.MOST_PACKED_KEYFRAME, limits.MOST_PACKED_KEYFRAME)
MOST_DESCRIPTOR = 100.0  # of a part of one
MOST_VOTES = 1e9
MOST_RUNS = 64  # of other registrars, that are known and that a summary names
MOST_HEAD = 1024  # bytes in which the name of a message is
NAMED = re.compile(r'\{"run":"(?:[^"\\]|\\.)*","keyframe":\d+')


class Name(NamedTuple):
    """Which keyframe it is, of all robots: ``run`` names one start of the registrar that stores it."""

    run: str
    keyframe_id: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Summary:
    """What others need to know of a keyframe to decide whether it may show a place of theirs.

    ``sightings``, at least one, have their robot, session and positions as the registrar that sends it has them, and no
    extent, score or camera. ``received`` has the newest keyframe of each other run that had been known when this one
    was sent.
    """

    name: Name
    frame_id: str
    clock: Clock
    sightings: tuple[Sighting, ...]
    received: Mapping[str, int] = field(default_factory=dict)

    @property
    def robot(self) -> str:
        """Whose keyframe it is."""
        return self.sightings[0].robot


class Request(NamedTuple):
    """A wish for a keyframe; the more ``votes``, the more it promises. ``asker`` is the run of who asks, if it says."""

    name: Name
    votes: float
    asker: str = ""


def pack_summary(summary: Summary) -> bytes:
    """A summary as bytes: about 60 for each object."""
    first = summary.sightings[0]
    head = {
        "run": summary.name.run,
        "keyframe": summary.name.keyframe_id,
        "robot": first.robot,
        "frame_id": summary.frame_id,
        "clock": list(summary.clock),
        "session": first.session,
        "stamp_ns": first.stamp_ns,
        "travelled": first.travelled,
        "by_odometry": int(first.by_odometry),
        "received": dict(summary.received),
        "labels": [sighting.label for sighting in summary.sightings],
    }
    positions = np.array([sighting.position for sighting in summary.sightings], "<f4")
    descriptors = np.array([sighting.descriptor for sighting in summary.sightings], "<f2")
    return SUMMARY.pack(head, positions.tobytes() + descriptors.tobytes())


def unpack_summary(packed: bytes) -> Summary:
    """The summary of `pack_summary`; ValueError if it is damaged, of another format, or too large."""
    return SUMMARY.unpack(packed, _summary)


def pack_request(request: Request) -> bytes:
    """A request as bytes."""
    run, number = request.name
    return REQUEST.pack({"run": run, "keyframe": number, "votes": request.votes, "asker": request.asker})


def unpack_request(packed: bytes) -> Request:
    """The request of `pack_request`; ValueError as in `unpack_summary`."""
    return REQUEST.unpack(packed, lambda head, _: _request(head))


def pack_delivery(run: str, keyframe: Keyframe) -> bytes:
    """A keyframe under its name, as bytes; ValueError if it is too large for it."""
    return DELIVERY.pack({"run": run, "keyframe": keyframe.keyframe_id}, pack_keyframe(keyframe))


def unpack_delivery(packed: bytes) -> tuple[Name, Keyframe]:
    """The keyframe of `pack_delivery`, with id 0 and without a robot; ValueError as in `unpack_summary`."""
    return DELIVERY.unpack(packed, lambda head, rest: (_name(head), unpack_keyframe(rest)))


def name_of(packed: bytes) -> Name:
    """The name at the head of a summary or a delivery, of which no more is unpacked; ValueError where there is none.

    Nothing else of the bytes is checked.
    """
    try:
        start = SUMMARY.unpack_start(packed, MOST_HEAD).decode(errors="ignore")
        named = NAMED.match(start)
        if named is None:
            raise ValueError(f"got {start[:40]!r}")
        return _name(json.loads(f"{named[0]}}}"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"expected a name, got {len(packed)} bytes without ({str(error)[:MOST_SAID]})") from error


def _request(head: Head) -> Request:
    """An older version names no asker."""
    return Request(_name(head), real(head, "votes", MOST_VOTES), text({"asker": "", **head}, "asker"))


def _name(head: Head) -> Name:
    return Name(text(head, "run"), whole(head, "keyframe", 1, MOST_WHOLE))


def _summary(head: Head, rest: bytes) -> Summary:
    count = within("objects", len(head["labels"]), limits.MOST_OBJECTS, 1)
    labels = [text({"label": label}, "label") for label in head["labels"]]
    if len(rest) != count * (12 + 2 * SIZE):
        raise ValueError(f"expected {count * (12 + 2 * SIZE)} bytes of {count} objects, got {len(rest)}")
    positions = _bounded("position", np.frombuffer(rest, "<f4", 3 * count).reshape(count, 3), limits.MOST_DISTANCE)
    descriptors = np.frombuffer(rest, "<f2", SIZE * count, 12 * count).reshape(count, SIZE)
    descriptors = _bounded("descriptor", descriptors, MOST_DESCRIPTOR).astype(np.float32)
    shared: dict[str, Any] = {
        "keyframe_id": _name(head).keyframe_id,
        "session": whole(head, "session", 0, MOST_WHOLE),
        "stamp_ns": whole(head, "stamp_ns", limits.LEAST_STAMP_NS, limits.MOST_STAMP_NS),
        "travelled": real(head, "travelled", limits.MOST_DISTANCE),
        "by_odometry": bool(whole(head, "by_odometry", 0, 1)),
        "robot": _robot(head),
        "score": 0.0,
        "extent": 0.0,
        "camera": np.zeros(3),
    }
    objects = enumerate(zip(labels, positions, descriptors, strict=True))
    return Summary(
        name=_name(head),
        frame_id=text(head, "frame_id"),
        clock=_clock(head),
        received=_received(head),
        sightings=tuple(
            Sighting(instance=k, label=label, position=position, descriptor=descriptor, **shared)
            for k, (label, position, descriptor) in objects
        ),
    )


def _robot(head: Head) -> str:
    """Whose keyframe it is: a closure to nobody's could be anyone's."""
    if not (robot := text(head, "robot")):
        raise ValueError("robot: expected the name of one, got none")
    return robot


def _clock(head: Head) -> Clock:
    began_ns, session = head["clock"]
    return Clock(
        within("clock", began_ns, limits.MOST_STAMP_NS, limits.LEAST_STAMP_NS), within("clock", session, MOST_WHOLE)
    )


def _received(head: Head) -> dict[str, int]:
    within("runs that were received", len(head["received"]), MOST_RUNS)
    return {
        text({"run": run}, "run"): within("received", number, MOST_WHOLE) for run, number in head["received"].items()
    }


def _bounded(name: str, numbers: Array, most: float) -> Array:
    if not (np.abs(numbers) <= most).all():
        raise ValueError(f"{name}: expected numbers up to {most:g}, got {np.abs(numbers).max():g}")
    return numbers.astype(float)
