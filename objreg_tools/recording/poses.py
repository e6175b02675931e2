# SPDX-License-Identifier: Apache-2.0
"""The poses that a recording holds, and what stands in their place where there was none."""

from __future__ import annotations

from objreg_ros.bridge.messages import motion_from_msg
from objreg_ros.data.frames import Odometry
from objreg_tools.recording.record import Record


def pose_of(record: Record) -> Odometry | None:
    """The pose in a record of a type that `motion_from_msg.odometry` reads; None where its numbers are none.

    A motion capture says zeros or NaN while it does not see its markers. What does not decode is none either.
    """
    try:
        return motion_from_msg.odometry(record.message)
    except ValueError:
        return None


def passed_over(count: int, of: int, what: str) -> list[str]:
    """A note for the user on ``count`` of ``of`` poses that were none; no note of 0."""
    note = (
        f"{count} of {of} poses of {what} are none (NaN, a quaternion of length 0, or broken bytes) and are passed over"
    )
    return [note] if count else []
