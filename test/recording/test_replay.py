# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from objreg_ros.bridge.messages import headers
from objreg_tools.recording import Recording, open_recording, write_rosbag2
from objreg_tools.recording.inputs import Inputs, choose_inputs
from objreg_tools.recording.record import Topic
from objreg_tools.recording.replay import Selection, graph_names, read_ahead, recorded_names
from objreg_tools.recording.rosbag.bags import latched_qos

from .sample_folders import STEP_NS, records, tum_folder


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    return open_recording(tum_folder(tmp_path, frames=11))


def test_inputs_go_out_under_the_names_of_the_graph(recording: Recording) -> None:
    assert graph_names(recording, choose_inputs(recording.topics)) == {
        "/image": "image",
        "/depth/image": "depth/image",
        "/camera_info": "camera_info",
        "/ground_truth": "ground_truth",
    }


def test_compressed_inputs_go_out_where_compressed_ones_are_subscribed_to(recording: Recording) -> None:
    recording.topics = {name: Topic(name, "sensor_msgs/msg/CompressedImage", 1) for name in ("/jpeg", "/png")}
    names = graph_names(recording, Inputs(image="/jpeg", depth="/png"))
    assert names == {"/jpeg": "image/compressed", "/png": "depth/image/compressedDepth"}


def test_everything_goes_out_under_its_own_name(recording: Recording) -> None:
    assert recorded_names(recording)["/depth/image"] == "/depth/image"


def test_a_selection_is_a_part_in_time_of_some_topics(recording: Recording) -> None:
    selection = Selection({"/image": "image"}, start=0.2, end=0.5)
    assert [r.stamp_ns // 10**6 for r in selection.records(recording)] == [200, 300, 400]
    assert selection.count(recording) == 3
    assert Selection({"/image": "image"}).count(recording) == 11
    assert Selection({"/image": "image"}, start=99).count(recording) == 0


def latched_infos(path: Path, *depths: int) -> Path:
    """A rosbag2 of 1 s whose camera_info, from as many publishers, came in its first four tenths only."""
    kept = [r for r in records(11) if r.topic != "/camera_info" or r.stamp_ns < 10**9 + 4 * STEP_NS]
    write_rosbag2(path, kept, offered_qos={"/camera_info": [latched_qos(depth) for depth in depths]})
    return path


@pytest.mark.parametrize(("depths", "latched_steps"), [((1,), [3]), ((0, 0), [2, 3]), ((2, 1), [1, 2, 3])])
def test_a_selection_begins_with_what_was_latched_before_it(
    depths: tuple[int, ...], latched_steps: list[int], tmp_path: Path
) -> None:
    with open_recording(latched_infos(tmp_path / "bag", *depths)) as recording:
        played = list(Selection({"/camera_info": "camera_info", "/image": "image"}, start=0.5).records(recording))
        latched, others = played[: len(latched_steps)], played[len(latched_steps) :]
        assert [headers.stamp_ns(r.message) for r in latched] == [10**9 + k * STEP_NS for k in latched_steps]
        assert {(r.topic, r.stamp_ns) for r in latched} == {("/camera_info", others[0].stamp_ns)}
        assert [r.topic for r in others] == ["/image"] * 6


def test_what_was_latched_is_played_once_and_only_if_it_is_selected(tmp_path: Path) -> None:
    with open_recording(latched_infos(tmp_path / "bag", 1)) as recording:
        assert sum(1 for _ in Selection({"/camera_info": "camera_info"}).records(recording)) == 4
        assert {r.topic for r in Selection({"/image": "image"}, start=0.5).records(recording)} == {"/image"}


@pytest.mark.parametrize(("start", "end"), [(99.0, None), (0.5, 0.2), (0.5, 0.5)])
def test_times_that_leave_nothing_are_refused(recording: Recording, start: float, end: float | None) -> None:
    with pytest.raises(ValueError, match=r"expected a part of the 1\.0 s of the recording, got"):
        Selection({"/image": "image"}, start, end).require_some(recording)


def test_a_part_of_the_recording_is_not_refused(recording: Recording) -> None:
    Selection({"/image": "image"}, 0.2, 99.0).require_some(recording)


def test_reading_ahead_changes_nothing() -> None:
    assert list(read_ahead(range(1000), ahead=3)) == list(range(1000))


def test_reading_ahead_reads_before_it_is_asked() -> None:
    read: list[int] = []

    def source() -> Iterator[int]:
        for i in range(100):
            read.append(i)
            yield i

    items = read_ahead(source(), ahead=5)
    assert next(items) == 0
    deadline = time.monotonic() + 60
    while len(read) < 6 and time.monotonic() < deadline:
        time.sleep(0.01)
    assert 6 <= len(read) <= 8
    items.close()  # type: ignore[attr-defined]


def test_an_error_of_the_reader_is_raised_where_the_items_are_used() -> None:
    def source() -> Iterator[int]:
        yield 1
        raise OSError("a broken file")

    items = read_ahead(source())
    assert next(items) == 1
    with pytest.raises(OSError, match="a broken file"):
        next(items)


def test_a_reader_that_nobody_wants_any_more_ends() -> None:
    items = read_ahead(iter(range(10**9)), ahead=2)
    next(items)
    items.close()  # type: ignore[attr-defined]
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("read ahead")]
