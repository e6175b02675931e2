# SPDX-License-Identifier: Apache-2.0
"""A file that is written without a library is read by one, whole and in order."""

from __future__ import annotations

from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from objreg_ros.blackbox import mcap
from objreg_ros.blackbox.mcap import Topic, write_mcap
from objreg_ros.whole_file import whole_file
from objreg_tools.recording import open_recording
from objreg_tools.recording.record import Record
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.rosbag.bag_errors import is_whole_mcap

HEADER = "std_msgs/msg/Header"
STAMPED = "builtin_interfaces/Time stamp\nstring frame_id\n" + "=" * 80
STAMPED += "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
TOPICS = (
    Topic("/a", HEADER, STAMPED),
    Topic("/kept", HEADER, STAMPED, latched=3),
    Topic("/text", "std_msgs/msg/String", "string data\n"),
)


def cdr_of(stamp_ns: int) -> bytes:
    return bytes(Record.of("/a", messages.header(stamp_ns, "camera"), stamp_ns).cdr)


@pytest.fixture
def entries() -> list[tuple[int, int, bytes]]:
    return [(k % 2, 10**18 + k, cdr_of(k * 10**6)) for k in range(200)]


def written(path: Path, entries: list[tuple[int, int, bytes]]) -> Path:
    with whole_file(path) as file:
        assert write_mcap(file, TOPICS, entries) == len(entries)
    return path


@pytest.mark.parametrize("chunk_bytes", [500, 10**6])
def test_what_was_written_is_read_in_its_order(
    chunk_bytes: int, entries: list[tuple[int, int, bytes]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap, "CHUNK_BYTES", chunk_bytes)
    path = written(tmp_path / "f.mcap", entries)
    assert is_whole_mcap(path)
    with AnyReader([path]) as reader:
        read = [(connection.topic, time_ns, bytes(data)) for connection, time_ns, data in reader.messages()]
        assert read == [(TOPICS[number].name, time_ns, cdr) for number, time_ns, cdr in entries]
        assert (reader.start_time, reader.message_count) == (10**18, 200)
        connection, _, data = next(reader.messages())
        assert reader.deserialize(data, connection.msgtype).frame_id == "camera"


def test_a_time_within_the_file_is_found_by_its_index(entries: list[tuple[int, int, bytes]], tmp_path: Path) -> None:
    with AnyReader([written(tmp_path / "f.mcap", entries)]) as reader:
        assert len(list(reader.messages(start=10**18 + 50, stop=10**18 + 60))) == 10


def test_what_is_latched_is_known_as_such(entries: list[tuple[int, int, bytes]], tmp_path: Path) -> None:
    with open_recording(written(tmp_path / "f.mcap", entries)) as recording:
        assert dict(recording.latched) == {"/kept": 3}


def test_a_file_without_messages_is_whole(tmp_path: Path) -> None:
    assert is_whole_mcap(written(tmp_path / "f.mcap", []))


def test_a_disk_that_is_full_is_an_error_and_leaves_nothing(
    entries: list[tuple[int, int, bytes]], tmp_path: Path
) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.fail("expected /dev/full")
    with pytest.raises(OSError, match="/dev/full"), whole_file(full) as file:
        write_mcap(file, TOPICS, entries)
    assert list(tmp_path.iterdir()) == []
