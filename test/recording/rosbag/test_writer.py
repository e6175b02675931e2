# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from rosbags.interfaces import QosDurability, QosReliability

from objreg_tools.recording import Record, open_recording, write_rosbag2
from objreg_tools.recording.rosbag.bags import latched_qos
from objreg_tools.recording.rosbag.writer import STORAGES, whole_or_gone
from recording.sample_folders import records, tum_folder


def test_a_folder_becomes_a_rosbag2_with_the_same_messages(tmp_path: Path) -> None:
    recording = open_recording(tum_folder(tmp_path / "tum"))
    assert write_rosbag2(tmp_path / "bag", recording.records()) == 12
    with open_recording(tmp_path / "bag") as bag:
        pairs = list(zip(recording.records(), bag.records(), strict=True))
        assert all(a.cdr == b.cdr and (a.topic, a.stamp_ns) == (b.topic, b.stamp_ns) for a, b in pairs)


@pytest.mark.parametrize("storage", STORAGES)
def test_topics_keep_the_qos_of_their_publishers(storage: str, tmp_path: Path) -> None:
    often = latched_qos(7)._replace(reliability=QosReliability.BEST_EFFORT, durability=QosDurability.VOLATILE)
    offered = {"/odom": [latched_qos(1)], "/image": [often, often]}
    write_rosbag2(tmp_path / "bag", records(), storage, offered)
    with open_recording(tmp_path / "bag") as bag:
        assert bag.offered_qos() == offered


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    with pytest.raises(FileExistsError, match="expected a new folder"):
        write_rosbag2(tmp_path, records())


def test_an_unknown_storage_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected one of mcap, sqlite3, got 'tape'"):
        write_rosbag2(tmp_path / "bag", records(), "tape")


def test_a_type_that_ros_2_does_not_ship_is_refused(tmp_path: Path) -> None:
    odd = Record("/odd", "my_msgs/msg/Odd", 1, lambda: None, lambda: b"")
    with pytest.raises(ValueError, match="expected a type that ROS 2 ships, got my_msgs/msg/Odd"):
        write_rosbag2(tmp_path / "bag", [odd])


def test_what_fails_leaves_no_folder(tmp_path: Path) -> None:
    def broken() -> Iterator[Record]:
        yield from records()
        raise ValueError("a broken picture")

    with pytest.raises(ValueError, match="a broken picture"):
        write_rosbag2(tmp_path / "bag", broken())
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_is_named_with_the_folder_which_is_gone(tmp_path: Path) -> None:
    said = r"room: expected a place that takes it, got: No space left on device; make room"
    with pytest.raises(OSError, match=said), whole_or_gone(tmp_path / "room"):
        (tmp_path / "room").mkdir()
        (tmp_path / "room/half").touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert not list(tmp_path.iterdir())
