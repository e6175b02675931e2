# SPDX-License-Identifier: Apache-2.0
"""An envelope: its head and bytes come back, and whatever is another's, cut off, damaged or too large is refused."""

from __future__ import annotations

import pytest

from objreg_ros.memory.envelope import Kind, by_lzma, by_zlib

KINDS = [by_lzma(b"ABC", "a letter", 1000, 5000), by_zlib(b"ABD", "a card", 1000, 5000)]
HEAD = {"name": "tasse à thé", "count": 3}


def _unpack(kind: Kind, packed: bytes) -> tuple[object, bytes]:
    return kind.unpack(packed, lambda head, rest: (head, rest))


@pytest.mark.parametrize("kind", KINDS)
def test_head_and_bytes_come_back(kind: Kind) -> None:
    for rest in (b"", b"\n\n", bytes(range(256))):
        assert _unpack(kind, kind.pack(HEAD, rest)) == (HEAD, rest)


@pytest.mark.parametrize("kind", KINDS)
def test_every_cut_and_every_flipped_bit_is_refused(kind: Kind) -> None:
    packed = kind.pack(HEAD, b"some bytes")
    flips = (
        packed[:k] + bytes([packed[k] ^ 1 << bit]) + packed[k + 1 :] for k in range(len(packed)) for bit in range(8)
    )
    for spoilt in (*flips, *(packed[:end] for end in range(len(packed))), packed + b"\0"):
        with pytest.raises(ValueError, match=f"expected {kind.name}"):
            _unpack(kind, spoilt)


def test_one_kind_is_not_taken_for_another() -> None:
    with pytest.raises(ValueError, match="expected a card, b'ABD' of format 1, got b'ABC' of format 1"):
        _unpack(KINDS[1], KINDS[0].pack(HEAD))


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_too_large_is_not_packed(kind: Kind) -> None:
    with pytest.raises(ValueError, match=f"expected {kind.name} of at most 5000 bytes unpacked, got .*fewer objects"):
        kind.pack(HEAD, bytes(5001))
    with pytest.raises(ValueError, match=f"expected {kind.name} of 13 to 1000 bytes, got 1001"):
        _unpack(kind, bytes(1001))
