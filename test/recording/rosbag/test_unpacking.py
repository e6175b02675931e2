# SPDX-License-Identifier: Apache-2.0
"""Recordings that are small, and would not be once they are unpacked."""

from __future__ import annotations

import bz2
import shutil
import sys
import tempfile
from collections import namedtuple
from pathlib import Path

import lz4.frame
import pytest
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from objreg_tools.recording import open_recording
from objreg_tools.recording.rosbag import unpacking
from objreg_tools.recording.rosbag.messages import standard_types
from objreg_tools.recording.rosbag.unpacking import UnpackingError, require_space, unpack_bz2, unpack_lz4, zstd_bound

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

KIND = "std_msgs/msg/String"
LONG = 3_000_000


def bag_of_zeros(path: Path, mode: CompressionMode, plugin: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """A rosbag2 of one message that says next to nothing at length."""
    types = standard_types()
    writer = Writer(path, version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/x", KIND, typestore=types)
        writer.write(connection, 5, types.serialize_cdr(types.types[KIND](data="0" * LONG), KIND))
    return path


def read(path: Path) -> list[str]:
    with open_recording(path) as recording:
        return [record.message.data for record in recording.records()]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """What unpacks to more than a megabyte is too much."""
    monkeypatch.setattr(unpacking, "CHUNK_BYTES", 1_000_000)
    monkeypatch.setattr(unpacking, "SMALL_BYTES", 1_000_000)


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE, CompressionMode.STORAGE])
def test_what_is_not_too_much_is_read(mode: CompressionMode, tmp_path: Path) -> None:
    assert read(bag_of_zeros(tmp_path / "bag", mode)) == ["0" * LONG]


@pytest.mark.parametrize("mode", [CompressionMode.MESSAGE, CompressionMode.STORAGE])
def test_a_chunk_or_message_that_becomes_too_much_is_refused(
    mode: CompressionMode, tmp_path: Path, small: None
) -> None:
    bag = bag_of_zeros(tmp_path / "bag", mode)
    with pytest.raises(
        ValueError, match=r"bag: expected a chunk or message that unpacks to at most 1000000 bytes, got"
    ):
        read(bag)


@pytest.mark.parametrize("compression", ["LZ4", "BZ2"])
def test_a_chunk_of_a_rosbag1_that_becomes_too_much_is_refused(compression: str, tmp_path: Path, small: None) -> None:
    types = get_typestore(Stores.ROS1_NOETIC)
    writer = Rosbag1Writer(tmp_path / "one.bag")
    writer.set_compression(Rosbag1Writer.CompressionFormat[compression])
    with writer:
        connection = writer.add_connection("/x", KIND, typestore=types)
        writer.write(connection, 5, types.serialize_ros1(types.types[KIND](data="0" * LONG), KIND))
    with pytest.raises(ValueError, match=r"one\.bag: expected a chunk or message that unpacks to at most"):
        read(tmp_path / "one.bag")


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_compressed_file_that_becomes_too_much_is_refused_and_nothing_is_unpacked(
    plugin: StoragePlugin, tmp_path: Path, small: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag, place = bag_of_zeros(tmp_path / "bag", CompressionMode.FILE, plugin), tmp_path / "place"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    with pytest.raises(ValueError, match=r"bag: expected compressed files that unpack to at most .* make room or"):
        open_recording(bag)
    assert not list(place.iterdir())


def test_a_header_that_lies_about_the_size_deceives_nobody(tmp_path: Path, small: None) -> None:
    bag = bag_of_zeros(tmp_path / "bag", CompressionMode.FILE)
    file = next(file for file in bag.iterdir() if file.suffix != ".yaml")
    frame = bytearray(zstd.compress(zstd.decompress(file.read_bytes())))
    assert frame[4] == 0b1000_0000  # the size of the content is in four bytes behind that of the window
    frame[6:10] = (1000).to_bytes(4, "little")
    file.write_bytes(frame)
    with pytest.raises(ValueError, match="expected compressed files that unpack to at most"):
        open_recording(bag)


def test_a_full_disk_is_no_place_to_unpack_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = bag_of_zeros(tmp_path / "bag", CompressionMode.FILE)
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**12, 10**12, unpacking.FREE_BYTES + LONG // 2))
    with pytest.raises(ValueError, match=rf"at most {LONG // 2} bytes in .*, got .* make room or set TMPDIR"):
        open_recording(bag)


@pytest.mark.parametrize("content", [b"", b"a" * 5, bytes(300_000), bytes(range(256)) * 3000])
@pytest.mark.parametrize("checksum", [False, True])
def test_the_bound_of_frames_is_never_less_than_what_they_hold(content: bytes, checksum: bool, tmp_path: Path) -> None:
    options = {zstd.CompressionParameter.checksum_flag: int(checksum)}
    whole = zstd.compress(content, options=options)
    compressor = zstd.ZstdCompressor(options=options)
    streamed = compressor.compress(content) + compressor.flush()
    skippable = b"\x5a\x2a\x4d\x18" + (3).to_bytes(4, "little") + b"abc"
    (tmp_path / "x").write_bytes(skippable + whole + streamed)
    assert len(content) * 2 <= zstd_bound(tmp_path / "x") <= (len(content) + (1 << 17)) * 2


def test_what_is_no_frame_has_no_bound_and_needs_no_room(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"")
    (tmp_path / "b").write_bytes(b"no frame at all")
    assert zstd_bound(tmp_path / "a") == zstd_bound(tmp_path / "b") == 0
    require_space(tmp_path)


def test_streams_are_unpacked_as_the_library_did() -> None:
    assert unpack_bz2(bz2.compress(b"a") + bz2.compress(b"b")) == b"ab"
    assert unpack_lz4(lz4.frame.compress(b"abc")) == b"abc"
    with pytest.raises(ValueError, match="ended before"):
        unpack_bz2(bz2.compress(b"abc" * 100)[:-8])


def test_lz4_is_unpacked_in_pieces_where_it_may_become_much(monkeypatch: pytest.MonkeyPatch) -> None:
    data = lz4.frame.compress(b"abc" * 100, store_size=False)
    monkeypatch.setattr(unpacking, "CHUNK_BYTES", 300)
    assert unpack_lz4(data) == b"abc" * 100
    with pytest.raises(ValueError, match="without an end"):
        unpack_lz4(data[:-8])
    monkeypatch.setattr(unpacking, "CHUNK_BYTES", 299)
    for frame in (data, lz4.frame.compress(b"abc" * 100)):
        with pytest.raises(UnpackingError, match="at most 299 bytes"):
            unpack_lz4(frame)
