# SPDX-License-Identifier: Apache-2.0
"""A key that robots share: what they send each other is signed, and nothing else is read.

The signature is HMAC-SHA256 (RFC 2104) over the topic's full name, the header, the format and the data of a
sensor_msgs/CompressedImage. It stands behind the data, and the format says so. What it does not give, docs/robots.md
says.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from array import array
from copy import copy
from pathlib import Path
from typing import Any

from sensor_msgs.msg import CompressedImage

from objreg_ros import limits
from objreg_ros.bridge.messages import headers

LEAST, MOST = 16, 4096  # bytes of a key
SIGNED = " hmac-sha256"  # behind the format
SIZE = hashlib.sha256().digest_size


class Key:
    """Signs what is sent, and checks what came; without a ``secret`` both leave a message as it is."""

    def __init__(self, secret: bytes = b"") -> None:
        self._secret = secret

    def sign(self, topic: str, message: CompressedImage) -> CompressedImage:
        """The message with its signature; ``topic`` is its full name."""
        if not self._secret:
            return message
        signature = self._signature(topic, message, message.format, message.data)
        return _with(message, message.format + SIGNED, bytes(message.data) + signature)

    def check(self, topic: str, message: Any) -> Any:
        """A message without its signature, once that is checked. ValueError for another one or none, where there is a
        key, and for a signature where there is none.
        """
        is_signed = message.format.endswith(SIGNED)
        if is_signed != bool(self._secret):
            expected, got = ("one", "none") if self._secret else ("none", "one")
            raise ValueError(f"{topic}: expected {expected} with a signature, got {got}; key_file is to be that of all")
        if not is_signed:
            return message
        if len(message.data) > limits.MOST_PACKED_KEYFRAME + SIZE:
            raise ValueError(f"{topic}: expected at most {limits.MOST_PACKED_KEYFRAME} bytes, got {len(message.data)}")
        data, form = bytes(message.data), message.format.removesuffix(SIGNED)
        body, signature = data[:-SIZE], data[-SIZE:]
        if not hmac.compare_digest(signature, self._signature(topic, message, form, body)):
            raise ValueError(f"{topic}: expected a signature by the key of key_file, got another one")
        return _with(message, form, body)

    def _signature(self, topic: str, message: Any, form: str, data: Any) -> bytes:
        header = [topic, headers.stamp_ns(message), message.header.frame_id, form]
        return hmac.digest(self._secret, json.dumps(header).encode() + b"\n" + bytes(data), "sha256")


def read_key(file: str) -> Key:
    """The key of a file, all of its bytes but for blanks around them; none for no file.

    ValueError for what is no key; OSError for what cannot be read.
    """
    if not file:
        return Key()
    path = Path(file).expanduser()
    if not path.is_file():
        raise ValueError(f"key_file: expected a file, got none at {path}")
    with path.open("rb") as opened:
        secret = opened.read(MOST + 1).strip()
    if not LEAST <= len(secret) <= MOST:
        raise ValueError(f"key_file: expected a key of {LEAST} to {MOST} bytes, got {len(secret)} in {path}")
    return Key(secret)


def _with(message: Any, form: str, packed: bytes) -> Any:
    changed, data = copy(message), array("B")
    data.frombytes(packed)
    changed.format, changed.data = form, data
    return changed
