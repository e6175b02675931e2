# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import shutil
import sqlite3
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from objreg_ros.bridge.messages import from_msg
from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.rosbag.bag_files import bag_files
from objreg_tools.recording.rosbag.messages import standard_types
from recording.sample_folders import noetic_bag, records, tum_folder

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

ENDS = {"mcap": ".mcap", "sqlite3": ".db3"}


def split(folder: Path, storage: str = "mcap", parts: int = 2) -> list[Path]:
    """The files of one recording of six frames without metadata.yaml."""
    folder.mkdir()
    said, made = list(records(6)), []
    for k in range(parts):
        part = folder.parent / f"part{k}"
        write_rosbag2(part, said[k * len(said) // parts : (k + 1) * len(said) // parts], storage)
        made.append(folder / f"run_{k + 8}{ENDS[storage]}")
        shutil.move(part / f"part{k}{ENDS[storage]}", made[-1])
    return made


def one(folder: Path, storage: str = "mcap") -> Path:
    """The file of a whole rosbag2."""
    write_rosbag2(folder, records(), storage)
    return next(file for file in folder.iterdir() if file.suffix == ENDS[storage])


def cut(file: Path) -> None:
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) * 2 // 3])


@pytest.mark.parametrize("storage", ENDS)
def test_files_without_metadata_are_one_recording_in_order_of_time(storage: str, tmp_path: Path) -> None:
    split(tmp_path / "bag", storage, parts=3)
    with open_recording(tmp_path / "bag") as recording:
        stamps = [record.stamp_ns for record in recording.records(["/image"])]
        assert stamps == [10**9 + k * 10**8 for k in range(6)]
        assert recording.topics["/image"].count == 6 and recording.seconds == pytest.approx(0.5)
        every = [record.stamp_ns for record in recording.records()]
        assert len(every) == 24 and all(a <= b for a, b in pairwise(every))
        assert list(recording.records(["/odom"], start_ns=2 * 10**9)) == []
    name = "run_8{0}, run_9{0}, run_10{0}".format(ENDS[storage])
    assert recording.notes == [f"no metadata.yaml: {name} are read as one recording, in order of time"]


def test_numbers_in_names_are_put_in_order_as_numbers(tmp_path: Path) -> None:
    for name in ("run_10.mcap", "run_9.mcap", "run_1.mcap", ".hidden.mcap", "run.txt"):
        (tmp_path / name).touch()
    assert [file.name for file in bag_files(tmp_path)] == ["run_1.mcap", "run_9.mcap", "run_10.mcap"]


@pytest.mark.parametrize(
    "content", ["", "\0" * 4096, "rosbag2_bagfile_information:\n  version: 9\n  sto", "version: [1, 2"]
)
def test_a_file_is_read_where_its_metadata_are_no_use(content: str, tmp_path: Path) -> None:
    file = one(tmp_path / "bag")
    (tmp_path / "bag/metadata.yaml").write_text(content)
    with open_recording(tmp_path / "bag") as recording:
        assert recording.topics["/image"].count == 3 and len(list(recording.records())) == 12
    (note,) = recording.notes
    assert note.startswith("metadata.yaml is not used (") and note.endswith(f"): {file.name} read without it")
    assert ("it is empty" in note) == (not content.strip("\0")) and "\n" not in note


def test_metadata_that_nest_without_end_are_refused_although_the_file_is_whole(tmp_path: Path) -> None:
    one(tmp_path / "bag")
    (tmp_path / "bag/metadata.yaml").write_text("rosbag2_bagfile_information: " + "[" * 5000)
    with pytest.raises(ValueError, match=r"got: RecursionError.*; move metadata\.yaml away: the files are read"):
        open_recording(tmp_path / "bag")


@pytest.mark.parametrize("storage", ENDS)
def test_messages_that_were_packed_one_by_one_are_read_without_metadata(storage: str, tmp_path: Path) -> None:
    plugin = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}[storage]
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=plugin)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        for record in records(1):
            connection = writer.add_connection(record.topic, record.msgtype, typestore=standard_types())
            writer.write(connection, record.stamp_ns, record.cdr)
    (tmp_path / "bag/metadata.yaml").unlink()
    with open_recording(tmp_path / "bag") as recording:
        record = next(recording.records(["/depth/image"]))
        assert from_msg.depth(record.message)[0, 0] == 1.0
        assert from_msg.depth(standard_types().deserialize_cdr(record.cdr, record.msgtype))[0, 0] == 1.0


def test_a_renamed_file_is_read_and_the_name_that_is_gone_is_said(tmp_path: Path) -> None:
    file = one(tmp_path / "bag")
    file.rename(file.with_name("kitchen.mcap"))
    with open_recording(tmp_path / "bag") as recording:
        assert recording.topics["/odom"].count == 3
        assert recording.notes == [
            "metadata.yaml is not used (it names bag.mcap, which is not there): kitchen.mcap read without it"
        ]


def test_a_file_that_metadata_do_not_name_is_said_and_not_read(tmp_path: Path) -> None:
    file = one(tmp_path / "bag")
    shutil.copy(file, file.with_name("older.mcap"))
    with open_recording(tmp_path / "bag") as recording:
        assert recording.topics["/image"].count == 3
        assert recording.notes == ["also there, and not read: older.mcap; name such a file to read it"]


def test_of_parts_the_broken_one_is_left_out_and_said(tmp_path: Path) -> None:
    _, last = split(tmp_path / "bag")
    cut(last)
    with open_recording(tmp_path / "bag") as recording:
        assert recording.topics["/image"].count == 3
        (note,) = recording.notes
    assert note.startswith("run_9.mcap is left out (") and "`mcap recover` saves what is readable" in note


def test_a_recovered_file_is_read_beside_the_broken_one(tmp_path: Path) -> None:
    file = one(tmp_path / "bag")
    shutil.copy(file, file.with_name("bag_recovered.mcap"))
    cut(file)
    with open_recording(tmp_path / "bag") as recording:
        assert recording.topics["/image"].count == 3 and "bag.mcap is left out" in recording.notes[0]


def test_where_every_part_is_broken_the_first_is_refused_by_name(tmp_path: Path) -> None:
    for file in split(tmp_path / "bag"):
        cut(file)
    with pytest.raises(ValueError, match=r"run_8\.mcap: expected a whole bag, got: .*`mcap recover`"):
        open_recording(tmp_path / "bag")


def test_copies_of_one_recording_are_not_read_as_its_parts(tmp_path: Path) -> None:
    file = one(tmp_path / "bag")
    (tmp_path / "bag/metadata.yaml").unlink()
    shutil.copy(file, file.with_name("copy.mcap"))
    with pytest.raises(ValueError, match=r"files that follow each other, got bag\.mcap and copy\.mcap"):
        open_recording(tmp_path / "bag")


def test_a_bag_of_each_ros_is_no_one_recording(tmp_path: Path) -> None:
    one(tmp_path / "bag")
    (tmp_path / "bag/metadata.yaml").unlink()
    noetic_bag(tmp_path / "bag/old.bag")
    with pytest.raises(ValueError, match=r"expected bag files of one kind, got bag\.mcap, old\.bag"):
        open_recording(tmp_path / "bag")


@pytest.mark.parametrize("named", ["file", "folder"])
def test_a_packed_file_without_metadata_is_unpacked(named: str, tmp_path: Path) -> None:
    file = one(tmp_path / "bag")
    packed = file.with_name("bag.mcap.zstd")
    packed.write_bytes(zstd.compress(file.read_bytes()))
    file.unlink()
    (tmp_path / "bag/metadata.yaml").unlink()
    with open_recording(packed if named == "file" else packed.parent) as recording:
        assert recording.topics["/image"].count == 3 and len(list(recording.records())) == 12


@pytest.mark.parametrize("with_metadata", [False, True])
def test_what_a_stopped_recorder_left_in_a_wal_file_is_read_too(with_metadata: bool, tmp_path: Path) -> None:
    file = one(tmp_path / "bag", "sqlite3")
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA wal_autocheckpoint=0")
    connection.execute("INSERT INTO messages SELECT id + 1000, topic_id, timestamp + 1000000000, data FROM messages")
    connection.commit()
    before = {path.name: path.read_bytes() for path in file.parent.iterdir()}
    connection.close()
    for name, content in before.items():
        (file.parent / name).write_bytes(content)
    if not with_metadata:
        (file.parent / "metadata.yaml").unlink()
    with open_recording(file.parent) as recording:
        assert recording.topics["/image"].count == 6
        assert recording.notes[0].startswith("bag.db3-wal holds what was not written into bag.db3 yet")
    assert file.read_bytes() == before[file.name]


def test_a_folder_of_pictures_says_that_a_bag_beside_them_is_not_read(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records())
    folder = tum_folder(tmp_path / "tum")
    shutil.move(tmp_path / "bag/bag.mcap", folder)
    recording = open_recording(folder)
    assert recording.kind == "TUM RGB-D folder"
    assert "also there, and not read: bag.mcap; name one to read it" in recording.notes


def test_the_error_of_a_folder_whose_only_file_is_empty_is_not_its_own_cause(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    write_rosbag2(folder, records(1))
    next(folder.glob("*.mcap")).write_bytes(b"")
    with pytest.raises(ValueError, match="seems to be empty") as refused:
        open_recording(folder)
    assert refused.value.__cause__ is not refused.value
