# SPDX-License-Identifier: Apache-2.0
"""Only what the key signed is read, and only where and as it was signed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from sensor_msgs.msg import CompressedImage

from objreg_ros import limits
from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.streams.key import SIGNED, SIZE, Key, read_key

OURS, OTHER, TOPIC = Key(b"0123456789abcdef"), Key(b"fedcba9876543210"), "/fleet/summaries"


def message() -> CompressedImage:
    return CompressedImage(header=to_msg.header(7, "camera"), format="objreg_exchange", data=b"summary")


def test_what_was_signed_comes_back_as_it_was_and_without_a_key_nothing_changes() -> None:
    signed = OURS.sign(TOPIC, message())
    assert signed.format == "objreg_exchange" + SIGNED and len(signed.data) == 7 + SIZE
    assert OURS.check(TOPIC, signed) == message() and len(signed.data) == 7 + SIZE
    assert Key().check(TOPIC, Key().sign(TOPIC, message())) == message()


def _flip(signed: CompressedImage) -> None:
    signed.data[0] ^= 1


def _set_format(signed: CompressedImage) -> None:
    signed.format = "objreg_other" + SIGNED


def _set_stamp(signed: CompressedImage) -> None:
    signed.header.stamp.nanosec += 1


def _set_frame(signed: CompressedImage) -> None:
    signed.header.frame_id = "b/camera"


def _cut(signed: CompressedImage) -> None:
    signed.data = signed.data[:5]


@pytest.mark.parametrize("change", [_flip, _set_format, _set_stamp, _set_frame, _cut])
def test_what_was_changed_after_it_was_signed_is_refused(change: Callable[[CompressedImage], None]) -> None:
    signed = OURS.sign(TOPIC, message())
    change(signed)
    with pytest.raises(ValueError, match="expected a signature by the key of key_file, got another one"):
        OURS.check(TOPIC, signed)


def test_another_key_another_topic_and_none_are_refused() -> None:
    with pytest.raises(ValueError, match="got another one"):
        OURS.check(TOPIC, OTHER.sign(TOPIC, message()))
    with pytest.raises(ValueError, match="got another one"):
        OURS.check("/r2/keyframes", OURS.sign("/r1/keyframes", message()))
    with pytest.raises(ValueError, match="expected one with a signature, got none"):
        OURS.check(TOPIC, message())
    with pytest.raises(ValueError, match="expected none with a signature, got one"):
        Key().check(TOPIC, OURS.sign(TOPIC, message()))


def test_what_is_too_large_is_refused_before_it_is_looked_through() -> None:
    large = message()
    large.format, large.data = large.format + SIGNED, bytes(limits.MOST_PACKED_KEYFRAME + SIZE + 1)
    with pytest.raises(ValueError, match="expected at most"):
        OURS.check(TOPIC, large)


def test_a_key_is_the_bytes_of_a_file_but_for_blanks_around_them(tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_bytes(b"0123456789abcdef\n")
    assert OURS.check(TOPIC, read_key(str(file)).sign(TOPIC, message())) == message()
    assert read_key("").sign(TOPIC, message()) == message()


@pytest.mark.parametrize("content", [b"", b"short\n", bytes(5000)])
def test_what_is_too_short_or_too_long_is_no_key(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_bytes(content)
    with pytest.raises(ValueError, match="key_file: expected a key of 16 to 4096 bytes, got"):
        read_key(str(file))
    with pytest.raises(ValueError, match="key_file: expected a file, got none"):
        read_key(str(tmp_path))
