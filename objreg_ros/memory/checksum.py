# SPDX-License-Identifier: Apache-2.0
"""Checksums of rows: a row of the store is read as it was written, or not at all."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

# Of a keyframe: what its sightings say of it too, and where it comes from.
HEAD = (*("id", "session", "stamp_ns", "robot", "origin"), *("travelled", "by_odometry"))
LIGHT = (
    *("id", "keyframe", "instance", "landmark", "label", "score", "extent", "sightings", "density"),
    *("position", "camera", "R_landmark_session", "descriptor", "cloud_crc"),
)  # of an object: all but its points


def seal(table: str, values: Iterable[Any]) -> int:
    """The checksum of what a row says, 32 bits: numbers, texts, bytes and None, with their types and in this order."""
    said = [(len(value), zlib.crc32(value)) if isinstance(value, bytes) else value for value in values]
    return zlib.crc32(ascii((table, *said)).encode())


def sealed_keyframe(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with ``seal``, of its head, and ``whole``, of everything that it says."""
    head = {**row, "seal": seal("keyframe", (row[name] for name in HEAD))}
    return {**head, "whole": seal("keyframe", _without(head, "whole"))}


def sealed_object(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with ``cloud_crc``, of its points, and ``seal``, of everything else and that."""
    return sealed_light({**row, "cloud_crc": zlib.crc32(row["cloud"])})


def sealed_light(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row of an object with ``seal`` anew; its points are as they were."""
    return {**row, "seal": seal("object", (row[name] for name in LIGHT))}


def sealed(table: str, row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with ``seal``, of everything else that it says."""
    return {**row, "seal": seal(table, _without(row, "seal"))}


def require_head(row: Mapping[str, Any], head: Sequence[str] = HEAD) -> None:
    """ValueError unless the ``head`` of a keyframe says what was written."""
    _require(f"keyframe {row['id']!r}", row["seal"], seal("keyframe", (row[name] for name in head)))


def require_keyframe(row: Mapping[str, Any]) -> None:
    """ValueError unless a keyframe says what was written."""
    _require("its row", row["whole"], seal("keyframe", _without(row, "whole")))


def require_light(row: Mapping[str, Any]) -> None:
    """ValueError unless an object says what was written, but for its points."""
    _require(
        f"object {row['instance']!r} of keyframe {row['keyframe']!r}",
        row["seal"],
        seal("object", [row[name] for name in LIGHT]),
    )


def require_object(row: Mapping[str, Any]) -> None:
    """ValueError unless an object says what was written, its points too."""
    require_light(row)
    cloud = row["cloud"]
    found = zlib.crc32(cloud) if isinstance(cloud, bytes) else None
    _require(f"the points of object {row['instance']!r}", row["cloud_crc"], found)


def require_sealed(what: str, table: str, row: Mapping[str, Any]) -> None:
    """ValueError unless a row with one ``seal`` says what was written."""
    _require(what, row["seal"], seal(table, _without(row, "seal")))


def _without(row: Mapping[str, Any], name: str) -> list[Any]:
    """The values but one, in the order of their names: rows that are written and rows that are read have their own."""
    return [row[key] for key in sorted(row.keys()) if key != name]


def _require(what: str, written: object, found: object) -> None:
    if written != found:
        raise ValueError(f"{what}: expected the checksum {written!r}, got {found}: it is damaged")
