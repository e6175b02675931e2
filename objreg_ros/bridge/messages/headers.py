# SPDX-License-Identifier: Apache-2.0
"""What a header says, bounded: the stamp and the frame. Reads attributes only, as `from_msg`."""

from __future__ import annotations

from typing import Any

from objreg_ros import limits


def stamp_ns(message: Any) -> int:
    """The time of a message with a header, of a Header, of a Time or of a value, in integer nanoseconds.

    ValueError for one that a ROS 2 message cannot carry: seconds of more than 32 bits, a second of nanoseconds.
    """
    if hasattr(message, "stamp_ns"):
        return int(message.stamp_ns)
    stamp = getattr(message, "header", message)
    stamp = getattr(stamp, "stamp", stamp)
    if not 0 <= stamp.nanosec < limits.NANOSECONDS:
        raise ValueError(f"stamp: expected nanoseconds below {limits.NANOSECONDS}, got {stamp.nanosec}")
    return stamp_within_limits(int(stamp.sec) * limits.NANOSECONDS + int(stamp.nanosec))


def stamp_within_limits(stamp_ns: int) -> int:
    if not limits.LEAST_STAMP_NS <= stamp_ns <= limits.MOST_STAMP_NS:
        raise ValueError(f"stamp: expected seconds of 32 bits, got {stamp_ns // limits.NANOSECONDS}")
    return stamp_ns


def bounded(text: str, of: str, most: int = limits.MOST_NAME) -> str:
    """The text; ValueError where it is longer than ``most`` characters."""
    if len(text) > most:
        raise ValueError(f"{of}: expected at most {most} characters, got {len(text)}: {text[:40]!r}…")
    return text


def frame_id(message: Any) -> str:
    """The frame of a message with a header, or of a value."""
    return str(getattr(message, "header", message).frame_id)


def when_and_where(message: Any) -> dict[str, Any]:
    """``stamp_ns`` and ``frame_id`` of a message with a header, as arguments of a data type."""
    return {"stamp_ns": stamp_ns(message), "frame_id": bounded(message.header.frame_id, "frame_id")}
