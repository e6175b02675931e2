# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from objreg_ros.bridge.messages import camera_from_msg, from_msg, motion_from_msg
from objreg_ros.bridge.messages.layout import OBJECTS, VIEW, table
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.recording.rosbag import messages
from recording.sample_folders import CAMERA

T = pose(rotation_from_vector(np.array([0.3, -0.2, 1.1])), np.array([1.0, -2.0, 0.5]))


def through_cdr(made: object) -> object:
    raw = messages.serialise(made)
    return messages.standard_types().deserialize_cdr(raw, made.__msgtype__)  # type: ignore[attr-defined]


def test_colour_and_depth_pass_through_their_bytes() -> None:
    rgb = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)
    assert np.array_equal(from_msg.image(through_cdr(messages.image(rgb, "rgb8", 5, "c"))).rgb, rgb)
    millimetres = np.full((48, 64), 1234, np.uint16)
    assert from_msg.depth(through_cdr(messages.image(millimetres, "16UC1", 5, "c")))[0, 0] == pytest.approx(1.234)


def test_a_camera_passes_through_its_bytes() -> None:
    info = through_cdr(messages.camera_info(CAMERA, 5, "c"))
    camera = camera_from_msg.intrinsics(info)
    assert (camera.fx, camera.cy, camera.width) == (CAMERA.fx, CAMERA.cy, CAMERA.width)
    assert np.array_equal(info.p.reshape(3, 4)[:, :3], info.k.reshape(3, 3)) and not info.p.reshape(3, 4)[:, 3].any()


@pytest.mark.parametrize("layout", [VIEW, OBJECTS])
def test_a_table_passes_through_its_bytes(layout: np.dtype) -> None:
    rows = np.frombuffer(np.random.default_rng(1).bytes(6 * layout.itemsize), layout).reshape(2, 3)
    assert table(through_cdr(messages.point_cloud(rows, 5, "c"))).tobytes() == rows.tobytes()


def test_poses_pass_through_their_bytes() -> None:
    stamped = motion_from_msg.odometry(through_cdr(messages.pose_stamped(T, 12_000_000_003, "world")))
    assert np.allclose(stamped.T_odom_body, T) and stamped.stamp_ns == 12_000_000_003
    moved = motion_from_msg.odometry(through_cdr(messages.odometry(T, np.eye(6), 5, "odom", "camera")))
    assert np.allclose(moved.T_odom_body, T) and moved.child_frame_id == "camera"


@pytest.mark.parametrize("stamp_ns", [0, 5, 12_000_000_003, 1_700_000_000_999_999_999])
def test_the_stamp_is_read_from_the_bytes_alone(stamp_ns: int) -> None:
    info = messages.camera_info(CAMERA, stamp_ns, "a camera")
    assert messages.header_stamp_ns(messages.serialise(info)) == stamp_ns
    big = messages.standard_types().serialize_cdr(info, info.__msgtype__, little_endian=False)
    assert messages.header_stamp_ns(bytes(big)) == stamp_ns


def test_bytes_without_room_for_a_stamp_are_refused() -> None:
    with pytest.raises(ValueError, match="got 7 bytes"):
        messages.header_stamp_ns(bytes(7))


def test_a_message_that_lacks_a_field_of_ros_2_is_refused() -> None:
    old = SimpleNamespace(__msgtype__="geometry_msgs/msg/Point", x=1.0, Y=2.0)
    with pytest.raises(ValueError, match=r"geometry_msgs/msg/Point: expected z, as in ROS 2, .*leave its topic out"):
        messages.serialise(old)


def test_what_keeps_an_old_type_from_being_brought_up_to_date_is_stated() -> None:
    noetic = get_typestore(Stores.ROS1_NOETIC)
    assert messages.obstacle("sensor_msgs/msg/CameraInfo", noetic) == ""
    assert messages.obstacle("visualization_msgs/msg/MarkerArray", noetic).startswith(
        "visualization_msgs/msg/Marker has no texture_resource"
    )
    assert messages.obstacle("rosgraph_msgs/msg/Log", noetic) == "ROS 2 does not ship rosgraph_msgs/msg/Log"


def test_a_type_whose_bytes_are_read_otherwise_in_ros_2_jazzy_is_stated() -> None:
    humble, foxy = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS2_FOXY)
    assert messages.difference("sensor_msgs/msg/Range", humble).endswith("other fields than in ROS 2 Jazzy: variance")
    assert "visualization_msgs/msg/Marker has other" in messages.difference("visualization_msgs/msg/MarkerArray", foxy)
    assert messages.difference("my_msgs/msg/Odd", humble) == "ROS 2 does not ship my_msgs/msg/Odd"


def test_every_type_of_ros_2_jazzy_is_read_as_it_is_written() -> None:
    types = messages.standard_types()
    assert not [why for kind in types.fielddefs if (why := messages.difference(kind, types))]
    bare = get_typestore(Stores.EMPTY)
    bare.register({"std_msgs/msg/Empty": ([], [])})
    assert messages.difference("std_msgs/msg/Empty", bare) == ""


def test_a_type_that_ros_2_does_not_ship_is_refused() -> None:
    with pytest.raises(ValueError, match="my_msgs/msg/Odd: expected a type that ROS 2 ships"):
        messages.serialise(SimpleNamespace(__msgtype__="my_msgs/msg/Odd"))
