# SPDX-License-Identifier: Apache-2.0
"""A stamp is read off the bytes of a message."""

from __future__ import annotations

import struct

import pytest

from objreg_ros.blackbox.stamps import header_stamp_ns


@pytest.mark.parametrize(("order", "mark"), [("<", b"\x00\x01\x00\x00"), (">", b"\x00\x00\x00\x00")])
def test_the_stamp_is_that_of_the_header_in_both_orders_of_bytes(order: str, mark: bytes) -> None:
    assert header_stamp_ns(mark + struct.pack(f"{order}iI", 12, 345) + b"rest") == 12_000_000_345


@pytest.mark.parametrize("cdr", [b"", b"\x00\x01\x00\x00abc", b"\x00\x01\x00\x00" + bytes(8)])
def test_a_message_that_is_too_short_or_has_no_stamp_has_none(cdr: bytes) -> None:
    assert header_stamp_ns(cdr) is None
