# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from objreg_tools.recording import Record, Recording, open_recording, write_rosbag2
from objreg_tools.recording.rosbag import messages
from objreg_tools.recording.summary import describe_topics

from .sample_folders import records


def bag(path: Path, items: Iterator[Record] | list[Record]) -> Recording:
    write_rosbag2(path, items)
    return open_recording(path)


def test_every_topic_is_listed_with_its_rate_and_its_first_message(tmp_path: Path) -> None:
    lines = {line.topic: line for line in describe_topics(bag(tmp_path / "bag", records(11)))}
    assert lines["/image"].rate == pytest.approx(10, rel=1e-6) and lines["/image"].count == 11
    assert lines["/image"].what == "64 × 48 rgb8, camera"
    assert lines["/camera_info"].what == "64 × 48 fx 50.0 fy 50.0 cx 31.5 cy 23.5"
    assert lines["/odom"].what == "odom → camera"


def test_a_cloud_is_listed_with_its_fields(tmp_path: Path) -> None:
    rows = np.zeros((2, 3), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    cloud = Record.of("/points", messages.point_cloud(rows, 5, "c"), 5)
    (line,) = describe_topics(bag(tmp_path / "bag", [cloud]))
    assert line.what == "3 × 2 organised, x y z, 12 bytes a point, c" and line.rate is None
