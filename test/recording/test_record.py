# SPDX-License-Identifier: Apache-2.0
"""What every recording and each of its records does."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from objreg_tools.recording.record import Record, Recording, Topic, misnamed
from objreg_tools.recording.rosbag import messages

from .sample_folders import CAMERA

INFO = messages.camera_info(CAMERA, 5, "camera")
T_ORIGIN = np.eye(4)


class MessagesByStamp(Recording):
    """A recording of so many topics, that knows when it is closed; its types are those of a ROS 1 if asked for."""

    def __init__(self, *msgtypes: str, span: tuple[int, int] = (0, 0), types: Typestore | None = None) -> None:
        self.path, self.kind, self.notes = Path(), "stamps", []
        self.topics = {f"/t{k}": Topic(f"/t{k}", msgtype, 1) for k, msgtype in enumerate(msgtypes)}
        self.start_ns, self.end_ns = span
        self.types, self.closed = types, 0

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        return iter(())

    def _types(self) -> Typestore:
        return self.types or super()._types()

    def close(self) -> None:
        self.closed += 1


def test_a_record_of_a_message_gives_it_back_with_its_type_and_the_time_it_was_recorded() -> None:
    record = Record.of("/camera_info", INFO, 7)
    assert record.message is INFO
    assert (record.topic, record.msgtype, record.stamp_ns) == ("/camera_info", "sensor_msgs/msg/CameraInfo", 7)
    assert messages.header_stamp_ns(record.cdr) == 5  # the time of the measurement is another


def test_the_bytes_of_a_record_are_those_of_its_message() -> None:
    record = Record.of("/camera_info", INFO, 7)
    again = messages.standard_types().deserialize_cdr(record.cdr, record.msgtype)
    assert again.k.tolist() == INFO.k.tolist() and again.header.frame_id == "camera"


def test_a_message_is_made_when_it_is_wanted_and_each_time_anew() -> None:
    made: list[int] = []

    def make() -> object:
        made.append(len(made))
        return messages.pose_stamped(T_ORIGIN, len(made), "map")

    record = Record.made("/pose", "geometry_msgs/msg/PoseStamped", 7, make)
    assert made == []
    assert [record.message.header.stamp.nanosec for _ in range(2)] == [1, 2]
    assert messages.header_stamp_ns(record.cdr) == 3
    assert made == [0, 1, 2]


def test_the_bytes_of_what_ros_2_does_not_ship_are_refused_and_its_message_is_not() -> None:
    odd = SimpleNamespace(__msgtype__="rosgraph_msgs/msg/Log", msg="hello")
    record = Record.of("/rosout", odd, 7)
    assert record.message.msg == "hello"
    with pytest.raises(ValueError, match="rosgraph_msgs/msg/Log: expected a type that ROS 2 ships"):
        _ = record.cdr


def test_what_does_not_decode_reads_as_nothing() -> None:
    def make() -> object:
        raise ValueError("broken bytes")

    assert Record.of("/camera_info", INFO, 7).read() is INFO
    assert Record.made("/camera_info", "sensor_msgs/msg/CameraInfo", 7, make).read() is None


def test_topics_that_ros_2_cannot_have_are_stated_with_the_reason_and_no_others() -> None:
    recording = MessagesByStamp("sensor_msgs/msg/Image", "my_msgs/msg/Odd", "rosgraph_msgs/msg/Log")
    assert recording.obstacles() == {
        "/t1": "ROS 2 does not ship my_msgs/msg/Odd",
        "/t2": "ROS 2 does not ship rosgraph_msgs/msg/Log",
    }
    assert MessagesByStamp().obstacles() == {}


@pytest.mark.parametrize("name", ["/camera/0/info", "/a/", "/a-b", "/a//b", "/é", "/" + "a" * 250, "/", ""])
def test_a_name_that_ros_2_does_not_allow_is_an_obstacle(name: str) -> None:
    recording = MessagesByStamp()
    recording.topics = {name: Topic(name, "sensor_msgs/msg/Image", 1)}
    assert recording.obstacles() == recording.obstacles(shipped_only=False) == {name: "no valid name in ROS 2"}


@pytest.mark.parametrize("name", ["/image", "image", "/camera_0/Info", "/_a/a__b/c9"])
def test_a_name_that_ros_2_allows_is_none(name: str) -> None:
    assert misnamed(name) == ""


def test_types_are_as_the_recording_knows_them() -> None:
    markers = "visualization_msgs/msg/MarkerArray"
    assert MessagesByStamp(markers).obstacles() == {}
    old = MessagesByStamp(markers, types=get_typestore(Stores.ROS1_NOETIC)).obstacles()
    assert list(old) == ["/t0"] and "has no texture_resource" in old["/t0"]


@pytest.mark.parametrize(
    ("span", "seconds"), [((10**9, 3_500_000_000), 2.5), ((7, 7), 0.0), ((10**9, 0), 0.0), ((0, 1), 1e-9)]
)
def test_a_recording_lasts_from_its_first_record_to_its_last_and_never_less_than_nothing(
    span: tuple[int, int], seconds: float
) -> None:
    assert MessagesByStamp(span=span).seconds == pytest.approx(seconds, abs=1e-12)


def test_a_recording_is_closed_when_it_is_left_even_by_an_error() -> None:
    with MessagesByStamp() as recording:
        assert isinstance(recording, MessagesByStamp) and recording.closed == 0
    assert recording.closed == 1
    with pytest.raises(OSError, match="gone"), recording:
        raise OSError("gone")
    assert recording.closed == 2


def test_what_cannot_be_read_in_order_of_time_is_no_recording() -> None:
    with pytest.raises(TypeError, match="records"):
        Recording()  # type: ignore[abstract]
