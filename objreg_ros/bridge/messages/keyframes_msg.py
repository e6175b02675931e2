# SPDX-License-Identifier: Apache-2.0
"""A packed keyframe on the air: a sensor_msgs/CompressedImage, whose format says what no picture is.

``objreg_keyframe run=<32 hex digits> began=<ns> first=<session>`` names a start of the keyframer, and the run of its
clock.
"""

from __future__ import annotations

import re
from array import array
from typing import Any, NamedTuple

from sensor_msgs.msg import CompressedImage

from objreg_ros import limits
from objreg_ros.bridge.messages import headers, to_msg

FORMAT = re.compile(r"objreg_keyframe run=(?P<run>[0-9a-f]{32}) began=(?P<began>-?\d{1,19}) first=(?P<first>\d{1,15})")


class SentKeyframe(NamedTuple):
    """What comes over the air: the keyframe of a camera at ``stamp_ns``, packed.

    ``run`` names a start of its keyframer; its clock began at ``began_ns`` with the session ``first``.
    """

    stamp_ns: int
    frame_id: str
    run: str
    began_ns: int
    first: int
    packed: bytes


def keyframe(sent: SentKeyframe) -> CompressedImage:
    """The message of a keyframe."""
    data = array("B")
    data.frombytes(sent.packed)
    return CompressedImage(
        header=to_msg.header(sent.stamp_ns, sent.frame_id),
        format=f"objreg_keyframe run={sent.run} began={sent.began_ns} first={sent.first}",
        data=data,
    )


def read_keyframe(message: Any) -> SentKeyframe:
    """The keyframe in a message, not unpacked yet. ValueError for a picture, and for what is too large a keyframe."""
    found = FORMAT.fullmatch(message.format)
    if found is None:
        raise ValueError(f"keyframe: expected format {FORMAT.pattern!r}, got {message.format[:100]!r}")
    if len(message.data) > limits.MOST_PACKED_KEYFRAME:
        raise ValueError(f"keyframe: expected at most {limits.MOST_PACKED_KEYFRAME} bytes, got {len(message.data)}")
    frame_id = headers.bounded(message.header.frame_id, "frame_id")
    clock = int(found["began"]), int(found["first"])
    return SentKeyframe(headers.stamp_ns(message), frame_id, found["run"], *clock, bytes(message.data))
