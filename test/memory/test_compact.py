# SPDX-License-Identifier: Apache-2.0
"""A packed keyframe comes back as it was but for the quantisation; any other bytes are refused, and take no memory."""

from __future__ import annotations

import json
import lzma
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

from objreg_ros import limits
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import FrameWindow
from objreg_ros.memory import compact
from objreg_ros.memory.compact import KEYFRAME, pack_keyframe, unpack_keyframe
from objreg_ros.memory.envelope import FILTERS, FORMAT, PREFIX
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.simulation.drawn_place import drawn

Change = Callable[[dict[str, Any]], None]


def place() -> Keyframe:
    keyframe = fuse(FrameWindow.of(drawn(7_000_000_001)), RegistrarParams())
    T = pose(rotation_from_vector(np.array([0.1, -2.0, 0.3])), np.array([1.0, 2.0, -3.0]))
    return replace(keyframe, session=3, T_odom_camera=T, by_odometry=True, travelled=12.5, turned=720.25)


PLACE = place()
PACKED = pack_keyframe(PLACE)
QUICK = [{"id": lzma.FILTER_LZMA2, "preset": 0, "dict_size": 1 << 20}]  # read as what others wrote


def sealed(body: bytes, size: int | None = None, form: int = FORMAT, magic: bytes = KEYFRAME.mark) -> bytes:
    """Bytes with a checksum that holds."""
    said = struct.pack("<I", len(body) if size is None else size)
    rest = lzma.compress(body, lzma.FORMAT_RAW, filters=QUICK)
    return PREFIX.pack(magic, form, zlib.crc32(said + rest), *struct.unpack("<I", said)) + rest


def body_of(packed: bytes) -> bytes:
    return lzma.decompress(packed[PREFIX.size :], lzma.FORMAT_RAW, filters=FILTERS)


def changed(change: Change) -> bytes:
    """The packed place with another head, and a checksum that holds."""
    line, rest = body_of(PACKED).split(b"\n", 1)
    head = json.loads(line)
    change(head)
    return sealed(json.dumps(head).encode() + b"\n" + rest)


def test_what_is_said_of_a_keyframe_comes_back_to_the_last_digit() -> None:
    back = unpack_keyframe(PACKED)
    names = ("session", "stamp_ns", "frame_id", "gravity_confidence", "by_odometry", "travelled", "turned", "labels")
    for name in names:
        assert getattr(back, name) == getattr(PLACE, name), name
    for name in ("T_odom_camera", "gravity"):
        assert np.array_equal(getattr(back, name), getattr(PLACE, name)), name
    assert back.view.intrinsics.cx == PLACE.view.intrinsics.cx and back.keyframe_id == 0
    for before, after in zip(PLACE.objects, back.objects, strict=True):
        assert after.sightings == before.sightings
        for name in ("score", "instance", "density"):
            assert getattr(after.cloud, name) == getattr(before.cloud, name)
        assert np.array_equal(after.cloud.flags, before.cloud.flags)


def test_what_was_measured_comes_back_within_the_steps_and_in_its_order() -> None:
    back = unpack_keyframe(PACKED)
    assert np.nanmax(np.abs(back.view.xyz - PLACE.view.xyz)) < 1e-3
    assert np.array_equal(np.isnan(back.view.xyz), np.isnan(PLACE.view.xyz))
    assert back.view.grey is not None and PLACE.view.grey is not None
    assert np.abs(back.view.grey.astype(int) - PLACE.view.grey).max() <= 1
    assert np.abs(back.context.xyz - PLACE.context.xyz).max() < 1.1e-3
    for before, after in zip(PLACE.objects, back.objects, strict=True):
        assert np.abs(after.cloud.xyz - before.cloud.xyz).max() < 1.1e-3
        assert (after.cloud.normals == before.cloud.normals).all()  # along an axis
        assert after.cloud.rgb is not None and np.abs(after.cloud.rgb.astype(int) - 127).max() <= 4


def test_what_is_missing_stays_missing() -> None:
    xyz = PLACE.view.xyz.copy()
    xyz[:40] = np.nan
    bare = replace(
        PLACE,
        view=replace(PLACE.view, xyz=xyz, grey=None),
        objects=(replace(PLACE.objects[0], cloud=replace(PLACE.objects[0].cloud, rgb=None)),),
        context=replace(PLACE.context, xyz=PLACE.context.xyz[:0], normals=PLACE.context.normals[:0]),
        gravity=None,
        T_odom_camera=None,
    )
    back = unpack_keyframe(pack_keyframe(bare))
    assert np.isnan(back.view.xyz[:40]).all() and np.isfinite(back.view.xyz[40:]).all()
    assert back.view.grey is None and back.gravity is None and back.T_odom_camera is None
    assert back.objects[0].cloud.rgb is None and len(back.objects) == 1 and len(back.context) == 0
    assert unpack_keyframe(pack_keyframe(replace(bare, objects=()))).objects == ()


def test_packing_what_came_back_gives_the_same_bytes() -> None:
    assert pack_keyframe(unpack_keyframe(PACKED)) == PACKED


def test_objects_are_thinned_until_the_bytes_are_few_enough() -> None:
    rng = np.random.default_rng(1)
    item = PLACE.objects[0]
    count = 3000
    rough = replace(
        item.cloud,
        xyz=rng.uniform(0.5, 1.5, (count, 3)).astype(np.float32),
        normals=np.tile(item.cloud.normals[:1], (count, 1)),
        flags=np.zeros(count, np.uint16),
        rgb=rng.integers(0, 256, (count, 3), np.uint8),
    )
    noisy = replace(PLACE, objects=(replace(item, cloud=rough),) * 3)
    whole = pack_keyframe(noisy, 10**9)
    most = int(0.7 * len(whole))
    packed = pack_keyframe(noisy, most)
    assert 0.8 * most < len(packed) <= most
    points = [len(item.cloud) for item in unpack_keyframe(packed).objects]
    assert len(set(points)) == 1 and 200 < points[0] < count


def test_a_keyframe_that_nobody_would_read_is_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, bound in (("most_packed", len(PACKED) - 1), ("most_unpacked", 1000)):
        monkeypatch.setattr(compact, "KEYFRAME", replace(KEYFRAME, **{name: bound}))
        with pytest.raises(ValueError, match=f"at most {bound} bytes.*, got .*make the view smaller"):
            pack_keyframe(PLACE)


def test_every_truncation_is_refused() -> None:
    for end in (*range(40), *range(40, len(PACKED), 97), len(PACKED) - 1):
        with pytest.raises(ValueError, match="expected a packed keyframe"):
            unpack_keyframe(PACKED[:end])
    with pytest.raises(ValueError, match="checksum"):
        unpack_keyframe(PACKED + b"\0")


@settings(max_examples=100, deadline=None, database=None)
@given(st.integers(0, 8 * len(PACKED) - 1))
def test_every_flipped_bit_is_refused(bit: int) -> None:
    spoilt = bytearray(PACKED)
    spoilt[bit // 8] ^= 1 << bit % 8
    with pytest.raises(ValueError, match="expected a packed keyframe"):
        unpack_keyframe(bytes(spoilt))


@settings(max_examples=20, deadline=None, database=None)
@given(st.binary(max_size=3000), st.integers(0, len(body_of(PACKED))))
def test_a_body_of_anything_under_a_checksum_that_holds_is_refused_or_a_keyframe(noise: bytes, at: int) -> None:
    body = body_of(PACKED)
    for hostile in (noise, body[:at] + noise + body[at + len(noise) :]):
        try:
            assert isinstance(unpack_keyframe(sealed(hostile)), Keyframe)
        except ValueError as error:
            assert "expected" in str(error) and len(str(error)) < 1000


@settings(max_examples=60, deadline=None, database=None)
@given(st.binary(min_size=1, max_size=40), st.integers(0, len(PACKED) - PREFIX.size - 1))
def test_damaged_compression_under_a_checksum_that_holds_is_refused(noise: bytes, at: int) -> None:
    size, rest = PACKED[PREFIX.size - 4 : PREFIX.size], PACKED[PREFIX.size :]
    for hostile in (rest[:at], rest[:at] + noise + rest[at + len(noise) + 1 :], rest + noise):
        checksum = zlib.crc32(size + hostile)
        packed = PREFIX.pack(KEYFRAME.mark, FORMAT, checksum, *struct.unpack("<I", size)) + hostile
        with pytest.raises(ValueError, match="expected"):
            unpack_keyframe(packed)


anything = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=9)
    | st.just(10**400)
    | st.just("\ud800"),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=8,
)


@settings(max_examples=25, deadline=None, database=None)
@given(st.data())
def test_a_head_that_lies_is_refused_or_a_keyframe(data: st.DataObject) -> None:
    def lie(head: dict[str, Any]) -> None:
        chosen = data.draw(st.sampled_from([head, *head["objects"]]))
        chosen[data.draw(st.sampled_from(sorted(chosen)))] = data.draw(anything)

    try:
        assert isinstance(unpack_keyframe(changed(lie)), Keyframe)
    except ValueError as error:
        assert "expected" in str(error)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda head: head.update(context=10**9), "expected context of 0 to 600000, got 1000000000"),
        (lambda head: head.update(context=-1), "expected context of 0"),
        (lambda head: head["objects"][0].update(points=0), "expected points of 1"),
        (lambda head: head["objects"][0].update(points=1_000_000), "expected points of objects of 0 to 1000000"),
        (lambda head: head["objects"][0].update(score=float("nan")), "score: expected a number of 0 to 1, got nan"),
        (lambda head: head["objects"][0].update(label="x" * 1001), "label: expected at most 1000 characters"),
        (lambda head: head["objects"][0].update(label="\ud800"), "label: expected at most 1000 characters"),
        (lambda head: head.update(objects=head["objects"] * 300), "expected objects of 0 to 500, got 600"),
        (lambda head: head.update(stamp_ns=2**62), "expected stamp_ns of"),
        (lambda head: head.update(session=-1), "expected session of 0"),
        (lambda head: head.update(session=True), "got True"),
        (lambda head: head.update(gravity=[0, 0, 2]), "expected a direction of length 1"),
        (lambda head: head.update(T_odom_camera=[1.0] * 16), "expected a rigid motion"),
        (
            lambda head: head.update(T_odom_camera=[1, 0, 0, 1e300, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "expected a camera within 1e+08 m, got 1e+300 m",
        ),
        (lambda head: head.update(camera='{"fx": 1}'), "expected fx fy cx cy width height"),
        (lambda head: head.update(camera=head["camera"].replace("160", "60000")), "expected pixels of a view"),
        (lambda head: head.pop("turned"), "turned"),
    ],
)
def test_a_lie_is_named(change: Change, said: str) -> None:
    with pytest.raises(ValueError, match="expected a packed keyframe, got") as raised:
        unpack_keyframe(changed(change))
    assert said in str(raised.value)


def test_an_object_behind_the_camera_is_refused() -> None:
    behind = replace(PLACE.objects[0].cloud, xyz=-PLACE.objects[0].cloud.xyz)
    packed = compact._packed(replace(PLACE, objects=(replace(PLACE.objects[0], cloud=behind),)))
    with pytest.raises(ValueError, match=r"before the camera or farther, got -1\."):
        unpack_keyframe(packed)


def test_another_format_is_refused_with_what_to_do() -> None:
    with pytest.raises(ValueError, match="of format 1, got b'OKF' of format 2; both ends must run the same version"):
        unpack_keyframe(sealed(body_of(PACKED), form=2))
    with pytest.raises(ValueError, match="got b'PNG' of format 1"):
        unpack_keyframe(sealed(body_of(PACKED), magic=b"PNG"))


@pytest.mark.parametrize("size", [1000, limits.MOST_UNPACKED_KEYFRAME, 2**32 - 1])
def test_a_bomb_takes_no_memory(size: int) -> None:
    bomb = sealed(bytes(20_000_000), size=size)
    assert len(bomb) < limits.MOST_PACKED_KEYFRAME
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"expected (a body of|a packed keyframe of at most 4000000 bytes)"):
            unpack_keyframe(bomb)
        assert tracemalloc.get_traced_memory()[1] < 4 * limits.MOST_UNPACKED_KEYFRAME
    finally:
        tracemalloc.stop()


def test_what_is_too_large_is_not_looked_at() -> None:
    with pytest.raises(ValueError, match="expected a packed keyframe of 13 to 1000000 bytes, got 1000001"):
        unpack_keyframe(bytes(1_000_001))
