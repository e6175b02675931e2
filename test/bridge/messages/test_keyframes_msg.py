# SPDX-License-Identifier: Apache-2.0
"""Packed keyframes as messages: there and back, and what is none."""

from __future__ import annotations

import pytest
from sensor_msgs.msg import CompressedImage

from objreg_ros import limits
from objreg_ros.bridge.messages.keyframes_msg import SentKeyframe, keyframe, read_keyframe

SENT = SentKeyframe(12_000_000_345, "camera", "0123456789abcdef" * 2, -5, 7, b"\x00packed\xff")


def test_a_keyframe_comes_back_as_it_was_sent() -> None:
    assert read_keyframe(keyframe(SENT)) == SENT


@pytest.mark.parametrize(
    "form",
    [
        "jpeg",
        "",
        SENT.run,
        f"objreg_keyframe run={'0' * 31} began=0 first=0",
        f"objreg_keyframe run={SENT.run} began=0 first={10**15}",
    ],
)
def test_a_picture_is_no_keyframe(form: str) -> None:
    message = keyframe(SENT)
    message.format = form
    with pytest.raises(ValueError, match="keyframe: expected format"):
        read_keyframe(message)


def test_what_is_too_large_is_refused_before_it_is_unpacked() -> None:
    message: CompressedImage = keyframe(SENT._replace(packed=bytes(limits.MOST_PACKED_KEYFRAME + 1)))
    with pytest.raises(ValueError, match="expected at most"):
        read_keyframe(message)
