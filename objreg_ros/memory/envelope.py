# SPDX-License-Identifier: Apache-2.0
"""The envelope of what is sent to other robots: a head, which is JSON, and bytes, compressed and with a checksum.

The bytes are a prefix (kind, format, checksum, size) and a compressed body: a line of JSON, and whatever follows it.
"""

from __future__ import annotations

import json
import lzma
import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

PREFIX = struct.Struct("<3sBII")  # kind, format, checksum of all that follows, bytes of the unpacked body
FORMAT = 1
MOST_SAID = 300  # characters of what was wrong
SMALLER = "; show fewer objects, or make the view smaller"
FILTERS = [  # half the time of the usual ones for one byte in sixty
    {"id": lzma.FILTER_LZMA2, "preset": 6, "dict_size": 1 << 20, "lc": 0, "lp": 0, "pb": 0}
    | {"mf": lzma.MF_HC3, "nice_len": 16, "depth": 4}
]
Head = Mapping[str, Any]
T = TypeVar("T")


class Reader(Protocol):
    """What decompresses a body, and no more of it than is asked for."""

    @property
    def eof(self) -> bool:
        """Whether the body came to its end."""
        ...

    @property
    def unused_data(self) -> bytes:
        """What comes after that."""
        ...

    def decompress(self, data: bytes, max_length: int, /) -> bytes:
        """At most so many bytes."""
        ...


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of envelope: its mark of three bytes, what it is called, and bytes that it may have at most."""

    mark: bytes
    name: str
    most_packed: int
    most_unpacked: int
    compress: Callable[[bytes], bytes]
    reader: Callable[[], Reader]

    def pack(self, head: Head, rest: bytes = b"") -> bytes:
        """Head and bytes in an envelope, for `unpack`. ValueError if they are beyond what is read."""
        body = json.dumps(head, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode() + b"\n" + rest
        self._require_size("bytes unpacked", len(body), self.most_unpacked, SMALLER)
        rest = struct.pack("<I", len(body)) + self.compress(body)
        packed = struct.pack("<3sBI", self.mark, FORMAT, zlib.crc32(rest)) + rest
        self._require_size("bytes", len(packed), self.most_packed, SMALLER)
        return packed

    def unpack(self, packed: bytes, made: Callable[[Any, bytes], T]) -> T:
        """What ``made`` makes of head and bytes; ValueError if they are damaged, too large or of another kind."""
        line, _, rest = self._body(packed).partition(b"\n")
        try:
            return made(json.loads(line), rest)
        except (LookupError, TypeError, AttributeError, ValueError, RecursionError, OverflowError) as error:
            raise ValueError(
                f"expected {self.name}, got {len(packed)} bytes that are none ({str(error)[:MOST_SAID]})"
            ) from error

    def unpack_start(self, packed: bytes, most: int) -> bytes:
        """The first bytes of the body, of which no more is unpacked; nothing else of the bytes is checked."""
        return self._decompressed(self.reader(), packed[PREFIX.size :], most)

    def _require_size(self, what: str, got: int, most: int, advice: str = "") -> None:
        if got > most:
            raise ValueError(f"expected {self.name} of at most {most} {what}, got {got}{advice}")

    def _body(self, packed: bytes) -> bytes:
        """What is within, of which no more is unpacked than the prefix says and than may be."""
        if not PREFIX.size < len(packed) <= self.most_packed:
            raise ValueError(
                f"expected {self.name} of {PREFIX.size + 1} to {self.most_packed} bytes, got {len(packed)}"
            )
        mark, form, checksum, size = PREFIX.unpack_from(packed)
        if (mark, form) != (self.mark, FORMAT):
            raise ValueError(
                f"expected {self.name}, {self.mark!r} of format {FORMAT}, got {mark!r} of format {form}; "
                "both ends must run the same version"
            )
        if checksum != (got := zlib.crc32(packed[PREFIX.size - 4 :])):
            raise ValueError(f"expected {self.name} with the checksum {checksum:08x}, got {got:08x}; it was damaged")
        self._require_size("bytes unpacked", size, self.most_unpacked)
        reader = self.reader()
        body = self._decompressed(reader, packed[PREFIX.size :], size + 1)
        if len(body) != size or not reader.eof or reader.unused_data:
            raise ValueError(f"expected a body of {size} bytes and nothing after it, got {len(body)} or another end")
        return body

    def _decompressed(self, reader: Reader, compressed: bytes, most: int) -> bytes:
        try:
            return reader.decompress(compressed, most)
        except (lzma.LZMAError, zlib.error) as error:
            raise ValueError(f"expected {self.name}, got what cannot be decompressed ({error})") from error


def by_lzma(mark: bytes, name: str, most_packed: int, most_unpacked: int) -> Kind:
    """A kind for large bodies, in raw LZMA2."""
    return Kind(
        mark, name, most_packed, most_unpacked, _lzma, lambda: lzma.LZMADecompressor(lzma.FORMAT_RAW, None, FILTERS)
    )


def by_zlib(mark: bytes, name: str, most_packed: int, most_unpacked: int) -> Kind:
    """A kind for small bodies, or for what is compressed already."""
    return Kind(
        mark, name, most_packed, most_unpacked, lambda body: zlib.compress(body, 9), lambda: zlib.decompressobj()
    )


def _lzma(body: bytes) -> bytes:
    return lzma.compress(body, lzma.FORMAT_RAW, filters=FILTERS)
