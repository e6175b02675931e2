# SPDX-License-Identifier: Apache-2.0
"""The stamp of a message in its bytes (CDR), which are never decoded."""

from __future__ import annotations

import struct

HEADER_FIRST = 4  # behind the four bytes that say how the rest is encoded
LITTLE = 1  # in the second of these


def header_stamp_ns(cdr: bytes) -> int | None:
    """The stamp in ns of a message that begins with its header; None for one too short, or without a stamp (0)."""
    if len(cdr) < HEADER_FIRST + 8:
        return None
    sec, nanosec = struct.unpack_from("<iI" if cdr[1] & LITTLE else ">iI", cdr, HEADER_FIRST)
    stamp_ns = int(sec) * 1_000_000_000 + int(nanosec)
    return stamp_ns if stamp_ns > 0 else None
