# SPDX-License-Identifier: Apache-2.0
"""Checksums of rows: a row of the store is read as it was written, or not at all."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from typing import Any

Row = dict[str, Any]


def checksum(table: str, values: Iterable[Any]) -> int:
    """The checksum of values, 32 bits: numbers, texts, bytes and None, with their types and in this order."""
    said = [(len(value), zlib.crc32(value)) if isinstance(value, bytes) else value for value in values]
    return zlib.crc32(ascii((table, *said)).encode())


def checksum_of(table: str, row: Mapping[str, Any], name: str = "checksum") -> int:
    """That of all columns but ``name``, in the order of their names: rows written and rows read have their own."""
    return checksum(table, (row[key] for key in sorted(row.keys()) if key != name))


def sealed(table: str, row: Mapping[str, Any]) -> Row:
    """The row with the ``checksum`` of all its other columns."""
    return {**row, "checksum": checksum_of(table, row)}


def require_sealed(what: str, table: str, row: Mapping[str, Any]) -> None:
    """ValueError unless a row is as it was written."""
    require_same(what, row["checksum"], checksum_of(table, row))


def require_same(what: str, written: object, found: object) -> None:
    """ValueError unless the two checksums are the same."""
    if written != found:
        raise ValueError(f"{what}: expected the checksum {written!r}, got {found}: it is damaged")
