# SPDX-License-Identifier: Apache-2.0
"""What registrars say to each other comes back as it was, but for float16; any other bytes are refused."""

from __future__ import annotations

import json
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from registration.samples import box, keyframe

from objreg_ros import limits
from objreg_ros.keyframes.frame_window import Clock
from objreg_ros.memory.compact import pack_keyframe
from objreg_ros.memory.envelope import FORMAT, PREFIX
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.registrar import summary as module
from objreg_ros.registrar.summary import (
    Name,
    Request,
    Summary,
    pack_delivery,
    pack_request,
    pack_summary,
    unpack_delivery,
    unpack_request,
    unpack_summary,
)
from objreg_ros.registration.keyframe import Keyframe

SUMMARY, REQUEST, DELIVERY = (kind.mark for kind in (module.SUMMARY, module.REQUEST, module.DELIVERY))
THINGS = tuple(box(label, (0.3 * k, 0.0, 1.0), instance=k) for k, label in enumerate(("cup", "tasse à thé", "book")))
PLACE: Keyframe = replace(keyframe(7, 12.5, THINGS, session=3), robot="robot2", by_odometry=True, travelled=4.25)
OF_PLACE = Summary(
    name=Name("abc", 7),
    frame_id="front",
    clock=Clock(5, 2),
    sightings=sightings_of(PLACE),
    received={"xyz": 41, "uvw": 1},
)
PACKED = pack_summary(OF_PLACE)
READERS: dict[bytes, Callable[[bytes], Any]] = {
    SUMMARY: unpack_summary,
    REQUEST: unpack_request,
    DELIVERY: unpack_delivery,
}


def sealed(kind: bytes, body: bytes, size: int | None = None, form: int = FORMAT) -> bytes:
    """Bytes with a checksum that holds."""
    said = struct.pack("<I", len(body) if size is None else size)
    rest = zlib.compress(body)
    return PREFIX.pack(kind, form, zlib.crc32(said + rest), *struct.unpack("<I", said)) + rest


def body_of(packed: bytes) -> bytes:
    return zlib.decompress(packed[PREFIX.size :])


def test_a_summary_comes_back_with_what_retrieval_needs() -> None:
    back = unpack_summary(PACKED)
    assert (back.name, back.frame_id, back.clock, back.received) == (
        OF_PLACE.name,
        "front",
        OF_PLACE.clock,
        OF_PLACE.received,
    )
    assert back.robot == "robot2" and len(back.sightings) == 3
    for before, after in zip(OF_PLACE.sightings, back.sightings, strict=True):
        for name in ("keyframe_id", "session", "stamp_ns", "label", "travelled", "by_odometry", "robot"):
            assert getattr(after, name) == getattr(before, name), name
        assert np.abs(after.position - before.position).max() < 1e-6
        assert np.abs(after.descriptor - before.descriptor).max() < 2e-3


def test_a_summary_is_small() -> None:
    many = tuple(box("cup", (0.1 * k, 0.0, 1.0), 0.05 + 0.01 * k, k) for k in range(15))
    packed = pack_summary(replace(OF_PLACE, sightings=sightings_of(keyframe(7, 12.5, many))))
    assert len(packed) < 1200


def test_a_request_and_a_keyframe_come_back() -> None:
    request = Request(Name("abc", 7), 3.25)
    assert unpack_request(pack_request(request)) == request
    name, came = unpack_delivery(pack_delivery("abc", PLACE))
    assert name == Name("abc", 7) and came.keyframe_id == 0
    assert (came.stamp_ns, came.session, came.labels) == (PLACE.stamp_ns, 3, PLACE.labels)


@pytest.mark.parametrize("kind", READERS)
def test_none_is_taken_for_another(kind: bytes) -> None:
    delivery = pack_delivery("abc", PLACE)
    for packed in (PACKED, pack_request(Request(Name("abc", 7), 1.0)), delivery):
        if packed[:3] != kind:
            with pytest.raises(ValueError, match=r"expected .* of format 1, got .*both ends must run the same version"):
                READERS[kind](packed)


def test_every_truncation_and_what_follows_is_refused() -> None:
    for end in range(len(PACKED)):
        with pytest.raises(ValueError, match="expected a summary"):
            unpack_summary(PACKED[:end])
    with pytest.raises(ValueError, match="checksum"):
        unpack_summary(PACKED + b"\0")


@settings(max_examples=100, deadline=None, database=None)
@given(st.integers(0, 8 * len(PACKED) - 1))
def test_every_flipped_bit_is_refused(bit: int) -> None:
    spoilt = bytearray(PACKED)
    spoilt[bit // 8] ^= 1 << bit % 8
    with pytest.raises(ValueError, match="expected"):
        unpack_summary(bytes(spoilt))


@settings(max_examples=60, deadline=None, database=None)
@given(st.binary(max_size=300), st.integers(0, len(body_of(PACKED))), st.sampled_from(sorted(READERS)))
def test_anything_under_a_checksum_that_holds_is_refused_or_read(noise: bytes, at: int, kind: bytes) -> None:
    body = body_of(PACKED)
    for hostile in (noise, body[:at] + noise + body[at + len(noise) :]):
        try:
            READERS[kind](sealed(kind, hostile))
        except ValueError as error:
            assert "expected" in str(error) and len(str(error)) < 1000


@pytest.mark.parametrize(
    ("lie", "said"),
    [
        (lambda head: head.update(robot=""), "robot: expected the name of one, got none"),
        (lambda head: head.update(labels=head["labels"] * 200), "expected objects of 1 to 500, got 600"),
        (lambda head: head.update(labels=[]), "expected objects of 1 to 500, got 0"),
        (lambda head: head.update(labels=["cup"]), "expected 66 bytes of 1 objects, got 198"),
        (lambda head: head.update(labels=["cup", 3, "book"]), "label: expected at most 1000 characters"),
        (lambda head: head.update(stamp_ns=2**62), "expected stamp_ns of"),
        (lambda head: head.update(keyframe=0), "expected keyframe of 1"),
        (lambda head: head.update(travelled=float("nan")), "travelled: expected a number"),
        (lambda head: head.update(clock=[1]), "not enough values"),
        (lambda head: head.update(clock=[1, -1]), "expected clock of 0"),
        (lambda head: head.update(received={str(k): 1 for k in range(65)}), "expected runs that were received of 0 to"),
        (lambda head: head.update(received=[1]), "has no attribute"),
        (lambda head: head.update(received={"a": True}), "expected received of 0"),
        (lambda head: head.pop("robot"), "robot"),
    ],
)
def test_a_lie_is_named(lie: Callable[[dict[str, Any]], None], said: str) -> None:
    line, rest = body_of(PACKED).split(b"\n", 1)
    head = json.loads(line)
    lie(head)
    with pytest.raises(ValueError, match="expected a summary, got") as stated:
        unpack_summary(sealed(SUMMARY, json.dumps(head).encode() + b"\n" + rest))
    assert said in str(stated.value)


@pytest.mark.parametrize(("at", "name"), [(0, "position"), (36, "descriptor")])
def test_numbers_that_are_none_are_refused(at: int, name: str) -> None:
    line, rest = body_of(PACKED).split(b"\n", 1)
    with pytest.raises(ValueError, match=f"{name}: expected numbers up to"):
        unpack_summary(sealed(SUMMARY, line + b"\n" + rest[:at] + b"\xff" * 4 + rest[at + 4 :]))


@pytest.mark.parametrize("size", [1000, limits.MOST_UNPACKED_SUMMARY, 2**32 - 1])
def test_a_bomb_takes_no_memory(size: int) -> None:
    bomb = sealed(SUMMARY, bytes(20_000_000), size=size)
    assert len(bomb) < limits.MOST_SUMMARY
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"expected (a body of|a summary of at most 400000 bytes)"):
            unpack_summary(bomb)
        assert tracemalloc.get_traced_memory()[1] < 8 * limits.MOST_UNPACKED_SUMMARY
    finally:
        tracemalloc.stop()


def test_what_is_too_large_is_neither_read_nor_written() -> None:
    with pytest.raises(ValueError, match="expected a request of 13 to 100000 bytes, got 100001"):
        unpack_request(bytes(100_001))
    many = replace(OF_PLACE, sightings=tuple(replace(one, label="x" * 1000) for one in OF_PLACE.sightings * 200))
    with pytest.raises(ValueError, match="expected a summary of at most 400000 bytes unpacked, got"):
        pack_summary(many)


def test_a_damaged_keyframe_within_is_refused() -> None:
    body = b'{"run":"abc","keyframe":7}\n' + pack_keyframe(PLACE)[:-1]
    with pytest.raises(ValueError, match="expected a packed keyframe"):
        unpack_delivery(sealed(DELIVERY, body))
