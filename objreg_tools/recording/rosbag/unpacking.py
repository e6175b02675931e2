# SPDX-License-Identifier: Apache-2.0
"""How much a compressed recording may become: `rosbags` unpacks whatever it is given, to memory and to the disk."""

from __future__ import annotations

import bz2
import mmap
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

import lz4.frame
from rosbags.rosbag1 import reader as rosbag1
from rosbags.rosbag2 import reader as rosbag2
from rosbags.rosbag2 import storage_mcap as mcap

CHUNK_BYTES = 1 << 30
"""The most that one chunk or message may become in memory; recorders make chunks of some megabytes."""

LZ4_RATIO = 256
"""LZ4 cannot say more with one byte."""

FREE_BYTES = 1 << 30
"""The space that stays free on the disk where a file is unpacked."""

SMALL_BYTES = 1 << 30
"""Up to this size a file is unpacked at any ratio."""

RATIO = 200
"""The most that a larger file may grow: what cameras record grows by less than 20."""

DISK_BYTES = 50 * 10**9
"""The most that one recording may become on the disk."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
BLOCK_BYTES = 1 << 17
RAW, RLE, COMPRESSED = 0, 1, 2


class UnpackingError(ValueError):
    """Compressed data would unpack to more than the limit."""


class Decompressor(Protocol):
    """What `bz2` and `zstd` have for pieces."""

    @property
    def eof(self) -> bool:
        """Whether the end of what was compressed has come."""

    @property
    def unused_data(self) -> bytes:
        """What stands behind that end."""

    def decompress(self, data: bytes, max_length: int) -> bytes:
        """At most so many bytes."""


class BoundedZstd:
    """A module of zstd whose `decompress` gives `CHUNK_BYTES` at most."""

    def __init__(self, module: Any) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)

    def decompress(self, data: bytes) -> bytes:
        """What one or more frames hold; `UnpackingError` for more than that."""
        return _unpack(self._module.ZstdDecompressor, data, self._module.ZstdError)


def bound_unpacking() -> None:
    """Put bounded decompressors in the place of those that `rosbags` calls; once is enough, twice does no harm."""
    for module in (rosbag2, mcap):
        _replace(module, "zstd", lambda zstd: zstd if isinstance(zstd, BoundedZstd) else BoundedZstd(zstd))
    _replace(mcap, "lz4_decompress", lambda _: unpack_lz4)
    getattr(rosbag1, "decompressors", {}).update(bz2=unpack_bz2, lz4=unpack_lz4)


def _replace(module: ModuleType, name: str, put: Callable[[Any], Any]) -> None:
    """Another version of the library may not have the name; the tests say so."""
    if hasattr(module, name):
        setattr(module, name, put(getattr(module, name)))


def unpack_bz2(data: bytes) -> bytes:
    """What one or more streams hold; `UnpackingError` for more than `CHUNK_BYTES`."""
    return _unpack(bz2.BZ2Decompressor, data, ValueError)


def unpack_lz4(data: bytes) -> bytes:
    """What a frame holds; `UnpackingError` for more than `CHUNK_BYTES`."""
    size = lz4.frame.get_frame_info(data)["content_size"]
    if size > CHUNK_BYTES:
        raise _too_much(len(data))
    if len(data) * LZ4_RATIO <= CHUNK_BYTES:
        return bytes(lz4.frame.decompress(data))
    one = lz4.frame.LZ4FrameDecompressor()
    unpacked = bytes(one.decompress(data, max_length=CHUNK_BYTES + 1))
    if len(unpacked) > CHUNK_BYTES:
        raise _too_much(len(data))
    if not one.eof:
        raise ValueError("LZ4 frame without an end")
    return unpacked


def _unpack(make: Callable[[], Decompressor], data: bytes, broken: type[Exception]) -> bytes:
    parts, size, packed = [], 0, len(data)
    while True:
        one = make()
        parts.append(one.decompress(data, CHUNK_BYTES + 1 - size))
        size += len(parts[-1])
        if size > CHUNK_BYTES:
            raise _too_much(packed)
        if not one.eof:
            raise broken("Compressed data ended before its end-of-stream marker")
        data = one.unused_data
        if not data:
            return parts[0] if len(parts) == 1 else b"".join(parts)


def _too_much(packed: int) -> UnpackingError:
    return UnpackingError(
        f"expected a chunk or message that unpacks to at most {CHUNK_BYTES} bytes, got {packed} bytes that become "
        "more; record it again in smaller chunks, if it is no attack"
    )


def require_space(bag: Path) -> None:
    """`UnpackingError` where compressed files of a rosbag2, unpacked into the temporary folder, become too much.

    Only those of a folder are unpacked there. The sizes are read off the frames: nothing is unpacked.
    """
    packed, unpacked = 0, 0
    for file in sorted(file for file in bag.iterdir() if file.is_file()) if bag.is_dir() else ():
        if size := zstd_bound(file):
            packed, unpacked = packed + file.stat().st_size, unpacked + size
    require_disk(packed, unpacked)


def require_disk(packed: int, unpacked: int) -> None:
    """`UnpackingError` where so many bytes, of so many packed ones, are too much for the temporary folder."""
    if not unpacked:
        return
    place = tempfile.gettempdir()
    free = shutil.disk_usage(place).free - FREE_BYTES
    most = min(DISK_BYTES, max(SMALL_BYTES, RATIO * packed), max(free, 0))
    if unpacked > most:
        raise UnpackingError(
            f"expected compressed files that unpack to at most {most} bytes in {place}, got {packed} bytes that may "
            f"become {unpacked}; make room or set TMPDIR, or unpack what you trust with `zstd -d` and reindex it"
        )


def zstd_bound(file: Path) -> int:
    """How many bytes a file of zstd frames becomes at most (RFC 8878); 0 for another kind of file.

    The header of a frame may lie, so the blocks count. A damaged file counts as far as it can be followed.
    """
    if file.stat().st_size < len(ZSTD_MAGIC):
        return 0
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return sum(_blocks(data)) if _is_frame(data, 0) else 0


def _is_frame(data: mmap.mmap, at: int) -> bool:
    return data[at : at + 4] == ZSTD_MAGIC or _is_skippable(data, at)


def _is_skippable(data: mmap.mmap, at: int) -> bool:
    return data[at + 1 : at + 4] == b"\x2a\x4d\x18" and data[at] >> 4 == 5


def _blocks(data: mmap.mmap) -> Iterator[int]:
    """The most that each block of each frame becomes."""
    at = 0
    while at + 4 < len(data) and _is_frame(data, at):
        if _is_skippable(data, at):
            at += 8 + int.from_bytes(data[at + 4 : at + 8], "little")
            continue
        descriptor = data[at + 4]
        at += 5 + _header_bytes(descriptor)
        last = False
        while not last and at + 3 <= len(data):
            header = int.from_bytes(data[at : at + 3], "little")
            last, kind, size = bool(header & 1), header >> 1 & 3, header >> 3
            yield BLOCK_BYTES if kind == COMPRESSED else size
            at += 3 + (1 if kind == RLE else size)
        at += 4 * (descriptor >> 2 & 1)  # checksum


def _header_bytes(descriptor: int) -> int:
    """What follows the descriptor of a frame before its first block: window, dictionary and size of the content."""
    single = descriptor >> 5 & 1
    content = (single, 2, 4, 8)[descriptor >> 6]
    return (1 - single) + (0, 1, 2, 4)[descriptor & 3] + content
