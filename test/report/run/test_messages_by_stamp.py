# SPDX-License-Identifier: Apache-2.0
"""Messages by their stamps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from recording.sample_folders import CAMERA, STEP_NS, records, uncalibrated

from objreg_ros.bridge.messages import camera_from_msg, headers
from objreg_tools.recording import Record, open_recording, write_rosbag2
from objreg_tools.recording.rosbag import messages
from objreg_tools.report.run.messages_by_stamp import SLOP_NS, CamerasByStamp, MessagesByStamp

FIRST_NS = 10**9


def recorded(path: Path, late_ns: int) -> Path:
    """Recorded so much later than stamped."""
    write_rosbag2(path, [replace(record, stamp_ns=record.stamp_ns + late_ns) for record in records(30)])
    return path


@pytest.mark.parametrize("late_ms", [0, 120, 200, 1000, -300, 3 * 365 * 86_400_000])
def test_a_message_is_found_by_its_stamp_whenever_it_was_recorded(tmp_path: Path, late_ms: int) -> None:
    with open_recording(recorded(tmp_path / "bag", late_ms * 1_000_000)) as recording:
        messages = MessagesByStamp(recording, "/depth/image")
        for k in (0, 7, 29):
            found = messages.nearest(FIRST_NS + k * STEP_NS + 1_000_000)
            assert found is not None and headers.stamp_ns(found) == FIRST_NS + k * STEP_NS


@pytest.mark.parametrize("late_ms", [0, 200])
def test_what_is_further_from_a_moment_than_the_slop_is_not_it(tmp_path: Path, late_ms: int) -> None:
    with open_recording(recorded(tmp_path / "bag", late_ms * 1_000_000)) as recording:
        messages = MessagesByStamp(recording, "/depth/image")
        assert messages.nearest(FIRST_NS - SLOP_NS - 1) is None and messages.nearest(FIRST_NS - SLOP_NS) is not None
        assert messages.nearest(10**15) is None and MessagesByStamp(recording, "/nothing").nearest(FIRST_NS) is None


def test_messages_whose_stamp_cannot_be_read_are_passed_over_and_counted(tmp_path: Path) -> None:
    with open_recording(recorded(tmp_path / "bag", 0)) as recording:
        whole = recording.records

        def broken(*asked: object) -> Iterable[Record]:
            return iter(replace(r, encode=lambda: b"") if r.stamp_ns == FIRST_NS else r for r in whole(*asked))

        recording.records = broken
        messages = MessagesByStamp(recording, "/depth/image")
        assert messages.nearest(FIRST_NS) is None and messages.unreadable == 1
        assert messages.nearest(FIRST_NS + STEP_NS) is not None


def info(stamp_ns: int, fx: float) -> Record:
    made = messages.camera_info(replace(CAMERA, fx=fx), stamp_ns, "camera")
    return Record.of("/camera_info", made, stamp_ns)


def test_the_camera_is_the_newest_calibrated_one_of_a_moment_or_else_the_first(tmp_path: Path) -> None:
    infos = [uncalibrated(1), info(20, 50.0), info(30, 50.0), info(40, 60.0), uncalibrated(50)]
    write_rosbag2(tmp_path / "bag", infos)
    with open_recording(tmp_path / "bag") as recording:
        cameras = CamerasByStamp(recording, "/camera_info")
        found = [camera_from_msg.intrinsics(cameras.at(stamp)).fx for stamp in (5, 20, 39, 40, 99)]
    assert found == [50.0, 50.0, 50.0, 60.0, 60.0]


def test_without_a_calibrated_camera_info_there_is_no_camera(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", [uncalibrated(1)])
    with open_recording(tmp_path / "bag") as recording:
        assert CamerasByStamp(recording, "/camera_info").at(5) is None and CamerasByStamp(recording, None).at(5) is None
