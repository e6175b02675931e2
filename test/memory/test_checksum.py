# SPDX-License-Identifier: Apache-2.0
"""Checksums: they differ where values, types or places do."""

from __future__ import annotations

import pytest

from objreg_ros.memory.checksum import checksum, require_sealed, sealed


def test_checksums_differ_by_values_types_and_tables() -> None:
    rows = [(1, 2), (2, 1), (1.0, 2), ("1", 2), (b"1", 2), (None, 2), (1, 2, None), (b"", b"12"), (b"1", b"2")]
    assert len({checksum("keyframe", row) for row in rows} | {checksum("object", rows[0])}) == len(rows) + 1


def test_a_checksum_is_the_same_whatever_the_order_of_the_columns() -> None:
    row = sealed("closure", {"id": 1, "labels": "é", "T": b"\0" * 9})
    require_sealed("closure 1", "closure", dict(reversed(row.items())))


def test_every_flipped_bit_of_a_value_breaks_the_checksum() -> None:
    row = sealed("closure", {"id": 1, "T": bytes(16)})
    for bit in range(128):
        damaged = (1 << bit).to_bytes(16, "little")
        with pytest.raises(ValueError, match=r"closure 1: .* damaged"):
            require_sealed("closure 1", "closure", {**row, "T": damaged})
