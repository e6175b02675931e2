# SPDX-License-Identifier: Apache-2.0
"""How the parts of a recorded robot sit on each other: all of the recording's /tf_static, whenever it was said."""

from __future__ import annotations

from contextlib import suppress

from objreg_ros.bridge.static_frames import StaticFrames
from objreg_ros.recording.record import Recording

TRANSFORMS = "tf2_msgs/msg/TFMessage"


def static_topics(recording: Recording) -> list[str]:
    """The topics of a recording that are its /tf_static, in any namespace."""
    return [t.name for t in recording.topics.values() if t.msgtype == TRANSFORMS and t.name.endswith("tf_static")]


def static_frames(recording: Recording) -> StaticFrames:
    """What they say; what does not decode is left out."""
    frames, topics = StaticFrames(), static_topics(recording)
    for record in recording.records(topics) if topics else ():
        with suppress(ValueError):
            frames.hear(record.message)
    return frames
