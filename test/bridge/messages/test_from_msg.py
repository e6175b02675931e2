# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bridge import sample_messages as messages
from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers, motion_from_msg
from objreg_ros.bridge.messages.layout import DETECTIONS, OBJECTS, SUPPORT_ID, VIEW
from objreg_ros.data.frames import FeltGravity
from objreg_ros.geometry import pose, rotation_from_vector

K = [500.0, 0, 31.5, 0, 510.0, 23.5, 0, 0, 1]
P = (400.0, 0, 30.5, -12.0, 0, 410.0, 22.5, 0, 0, 0, 1, 0)
UNCALIBRATED = messages.camera_info([0.0] * 9, 4, 3)
PACKED = np.dtype({"names": ["x", "y", "z", "rgb"], "formats": ["<f4"] * 4, "offsets": [0, 4, 8, 16], "itemsize": 32})


def packed_cloud(height: int = 3, width: int = 4) -> np.ndarray:
    records = np.zeros((height, width), PACKED)
    for i, name in enumerate("xyz"):
        records[name] = np.arange(height * width).reshape(height, width) + 100 * i
    records["rgb"] = np.full((height, width), 0x00102030, "u4").view("f4").astype(PACKED["rgb"])
    return records


def test_the_stamp_of_a_header_a_message_and_a_time_is_the_same() -> None:
    message = messages.cloud(packed_cloud(), stamp_ns=12_000_000_345)
    assert {headers.stamp_ns(m) for m in (message, message.header, message.header.stamp)} == {12_000_000_345}


def test_depth_comes_with_the_size_of_its_camera() -> None:
    raw = messages.image(np.full((48, 64), 1500, np.uint16), "16UC1")
    image = from_msg.depth_image(raw, messages.camera_info(K, 64, 48))
    assert image.depth.shape == (48, 64) and image.depth[0, 0] == pytest.approx(1.5)
    with pytest.raises(ValueError, match=r"expected camera_info's size 32 × 24, got 64 × 48"):
        from_msg.depth_image(raw, messages.camera_info(K, 32, 24))


def test_colour_of_another_size_is_not_taken_for_registered() -> None:
    raw = messages.image(np.full((48, 64), 1500, np.uint16), "16UC1")
    small, fitting = (messages.image(np.zeros((h, 64, 3), np.uint8), "rgb8") for h in (24, 48))
    info = messages.camera_info(K, 64, 48)
    assert from_msg.depth_image(raw, info, small).rgb is None
    assert from_msg.depth_image(raw, info, fitting).rgb is not None


def test_an_uncalibrated_camera_is_refused() -> None:
    with pytest.raises(ValueError, match="calibrated K"):
        camera_from_msg.intrinsics(UNCALIBRATED)


def test_binning_and_region_of_interest_move_the_camera() -> None:
    info = messages.camera_info(K, 64, 48)
    info.binning_x = info.binning_y = 2
    info.roi.x_offset, info.roi.y_offset, info.roi.width, info.roi.height = 10, 4, 40, 30
    camera = camera_from_msg.intrinsics(info)
    assert (camera.fx, camera.cx, camera.cy) == (250.0, 10.75, 9.75)
    assert (camera.width, camera.height) == (20, 15)


def test_each_axis_is_binned_by_its_own_number() -> None:
    info = messages.camera_info(K, 64, 48)
    info.binning_x, info.binning_y, info.roi.y_offset = 2, 4, 4
    camera = camera_from_msg.intrinsics(info)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (250.0, 127.5, 15.75, 4.875)
    assert (camera.width, camera.height) == (32, 12)


def test_intrinsics_of_ros_1_are_read_too() -> None:
    info = messages.camera_info(K, 64, 48)
    info.K, info.P = info.k, info.p
    del info.k, info.p
    assert camera_from_msg.intrinsics(info).fy == 510.0
    info.P = P
    assert camera_from_msg.intrinsics(info).fy == 410.0


def test_the_camera_of_a_rectified_picture_is_that_of_the_projection_matrix() -> None:
    info = messages.camera_info(K, 64, 48, P)
    camera = camera_from_msg.intrinsics(info)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (400.0, 410.0, 30.5, 22.5)
    info.binning_x = info.binning_y = 2
    info.roi.x_offset, info.roi.y_offset, info.roi.width, info.roi.height = 10, 4, 40, 30
    camera = camera_from_msg.intrinsics(info)
    assert (camera.fx, camera.cx, camera.cy) == (200.0, 10.25, 9.25)


@pytest.mark.parametrize("f", [-400.0, float("nan")])
@pytest.mark.parametrize("axis", [0, 5])
def test_a_projection_matrix_that_cannot_be_is_refused_though_K_could(f: float, axis: int) -> None:
    with pytest.raises(ValueError, match=r"expected a calibrated P with focal lengths above 0, got .*(-400|nan)"):
        camera_from_msg.intrinsics(messages.camera_info(K, 64, 48, (*P[:axis], f, *P[axis + 1 :])))


def test_the_view_is_of_the_camera_of_its_projection_matrix() -> None:
    view = from_msg.view(messages.cloud(packed_cloud()), messages.camera_info(K, 4, 3, P))
    assert (view.intrinsics.fx, view.intrinsics.cx) == (400.0, 30.5)


def test_an_organised_cloud_needs_no_camera_and_so_no_calibration() -> None:
    cloud = from_msg.point_cloud(messages.cloud(packed_cloud()))
    assert camera_from_msg.camera_of_cloud(None, cloud) is None
    assert camera_from_msg.camera_of_cloud(UNCALIBRATED, cloud) is None
    for calibrated, fx in ((messages.camera_info(K, 4, 3), 500.0), (messages.camera_info([0.0] * 9, 4, 3, P), 400.0)):
        camera = camera_from_msg.camera_of_cloud(calibrated, cloud)
        assert camera is not None and camera.fx == fx
    with pytest.raises(ValueError, match=r"expected a calibrated K with focal lengths above 0, got .-1"):
        camera_from_msg.camera_of_cloud(messages.camera_info([-1.0, *K[1:]], 4, 3), cloud)


def test_an_uncalibrated_camera_projects_no_cloud_and_no_depth() -> None:
    cloud = from_msg.point_cloud(messages.cloud(packed_cloud(height=1)))
    assert camera_from_msg.camera_of_cloud(None, cloud) is None
    with pytest.raises(ValueError, match=r"expected a calibrated K with focal lengths above 0, got .0"):
        camera_from_msg.camera_of_cloud(UNCALIBRATED, cloud)
    with pytest.raises(ValueError, match=r"expected a calibrated K with focal lengths above 0, got .0"):
        from_msg.depth_image(messages.image(np.full((3, 4), 1500, np.uint16), "16UC1"), UNCALIBRATED)


@pytest.mark.parametrize("pad", [0, 5])
def test_a_cloud_is_read_with_its_padding(pad: int) -> None:
    cloud = from_msg.point_cloud(messages.cloud(packed_cloud(), pad))
    assert cloud.organised and cloud.xyz[1, 2].tolist() == [6, 106, 206]
    assert cloud.rgb is not None and cloud.rgb[2, 3].tolist() == [0x10, 0x20, 0x30]


def test_a_big_endian_cloud_gives_the_same_points() -> None:
    big = np.dtype([(name, ">f4") for name in ("x", "y", "z", "rgb")])
    records = packed_cloud().astype(big)
    cloud = from_msg.point_cloud(messages.cloud(records))
    assert cloud.xyz[1, 2].tolist() == [6, 106, 206]
    assert cloud.rgb is not None and cloud.rgb[0, 0].tolist() == [0x10, 0x20, 0x30]


def test_fields_in_any_order_and_type_are_read() -> None:
    mixed = np.dtype([("z", "<f8"), ("rgba", "<u4"), ("x", "<f4"), ("y", "<i2")])
    records = np.zeros((1, 2), mixed)
    records["z"], records["x"], records["y"], records["rgba"] = 2.5, 1.5, -3, 0xFF0A0B0C
    cloud = from_msg.point_cloud(messages.cloud(records))
    assert cloud.xyz[0, 1].tolist() == [1.5, -3, 2.5]
    assert cloud.rgb is not None and cloud.rgb[0, 0].tolist() == [10, 11, 12]


def test_a_column_of_points_comes_as_a_row() -> None:
    cloud = from_msg.point_cloud(messages.cloud(packed_cloud(6, 1)))
    assert cloud.xyz.shape == (1, 6, 3) and not cloud.organised


def test_a_point_that_is_infinite_in_one_axis_is_not_measured() -> None:
    records = packed_cloud()
    records["y"][1, 1] = np.inf
    cloud = from_msg.point_cloud(messages.cloud(records))
    assert np.isnan(cloud.xyz[1, 1]).all() and np.isfinite(cloud.xyz[1, 2]).all()


def test_a_cloud_of_nothing_but_nan_is_still_a_cloud() -> None:
    records = packed_cloud()
    records["x"] = np.nan
    assert np.isnan(from_msg.point_cloud(messages.cloud(records)).xyz).all()


def test_a_truncated_cloud_is_refused_with_expected_and_got() -> None:
    message = messages.cloud(packed_cloud())
    message.data = message.data[:-40]
    with pytest.raises(ValueError, match=r"expected 384 bytes for 4 × 3 points, got 344"):
        from_msg.point_cloud(message)


def test_a_missing_field_is_named() -> None:
    records = np.zeros((2, 2), [("x", "<f4"), ("y", "<f4")])
    with pytest.raises(ValueError, match="expected the fields x, y, z, got x, y"):
        from_msg.point_cloud(messages.cloud(records))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"point_step": 8}, "within point_step 8"),
        ({"point_step": 0}, "expected a point_step of 1 to 65536 bytes, got 0"),
        ({"row_step": 4}, "row_step of at least"),
        ({"height": 2**32 - 1}, "truncated"),
        ({"width": 2**31}, "row_step of at least"),
        ({"width": 0}, "expected points"),
        ({"height": 0}, "expected points"),
        ({"fields": []}, "expected the fields x, y, z, got none"),
    ],
)
def test_an_absurd_cloud_is_refused(change: dict, complaint: str) -> None:
    message = messages.cloud(packed_cloud())
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=complaint):
        from_msg.point_cloud(message)


def test_a_datatype_that_does_not_exist_is_refused() -> None:
    message = messages.cloud(packed_cloud())
    message.fields[1].datatype = 9
    with pytest.raises(ValueError, match=r"datatype 1..8 of field 'y', got 9"):
        from_msg.point_cloud(message)


def test_odometry_is_a_pose() -> None:
    half = np.sqrt(0.5)
    odometry = motion_from_msg.odometry(messages.odometry((0, 0, half, half), (1, 2, 3)))
    assert np.allclose(odometry.T_odom_body[:3, :3], rotation_from_vector(np.array([0, 0, np.pi / 2])))
    assert odometry.T_odom_body[:3, 3].tolist() == [1, 2, 3] and odometry.child_frame_id == "base_link"


def test_gravity_is_down_in_the_frame_of_a_level_odometry() -> None:
    half = np.sqrt(0.5)
    on_its_side = motion_from_msg.odometry(
        messages.odometry((half, 0, 0, half), (1, 2, 3))
    )  # a quarter turn about x: the body's y is up
    assert motion_from_msg.level_gravity(0, None) is None
    assert np.allclose(motion_from_msg.level_gravity(0, (motion_from_msg.odometry(messages.odometry()),)), (0, 0, -1))
    assert np.allclose(motion_from_msg.level_gravity(0, (on_its_side,)), (0, -1, 0))
    T_body_camera = pose(rotation_from_vector(np.array([0, 0, np.pi / 2])), np.ones(3))  # the body's y is its x
    assert np.allclose(motion_from_msg.level_gravity(0, (on_its_side,), T_body_camera), (-1, 0, 0))


def imu(**changes: object) -> SimpleNamespace:
    """An Imu at rest in an upright camera, without an orientation."""
    fields = {
        "linear_acceleration": SimpleNamespace(x=0.0, y=-9.8, z=0.1),
        "angular_velocity": SimpleNamespace(x=0.1, y=0.2, z=0.3),
        "orientation": SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
        "linear_acceleration_covariance": np.zeros(9),
        "angular_velocity_covariance": np.zeros(9),
        "orientation_covariance": np.array([-1.0, *np.zeros(8)]),
    }
    header = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=5), frame_id="imu")
    return SimpleNamespace(header=header, **{**fields, **changes})


def test_an_imu_gives_what_its_covariances_say_that_it_measures() -> None:
    sample = motion_from_msg.imu(imu())
    assert sample.acceleration is not None and sample.acceleration.tolist() == [0.0, -9.8, 0.1]
    assert sample.angular_velocity is not None and sample.angular_velocity.tolist() == [0.1, 0.2, 0.3]
    assert (sample.orientation, sample.stamp_ns, sample.frame_id) == (None, 1_000_000_005, "imu")
    unknown = np.array([-1.0, *np.zeros(8)])
    sample = motion_from_msg.imu(imu(linear_acceleration_covariance=unknown, angular_velocity_covariance=unknown))
    assert sample.acceleration is None and sample.angular_velocity is None


def test_an_orientation_is_a_unit_quaternion_that_somebody_set() -> None:
    known = {"orientation_covariance": np.diag([4e-4, 1e-4, 9.0]).ravel()}
    sample = motion_from_msg.imu(imu(**known))
    assert sample.orientation is not None and sample.orientation_sigma_deg == pytest.approx(np.degrees(0.02))
    empty = np.zeros(9)
    assert motion_from_msg.imu(imu(orientation_covariance=empty)).orientation is None
    turned = SimpleNamespace(x=0.6, y=0.0, z=0.0, w=0.8)
    assert motion_from_msg.imu(imu(orientation_covariance=empty, orientation=turned)).orientation is not None
    nothing = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)
    assert motion_from_msg.imu(imu(**known, orientation=nothing)).orientation is None


@pytest.mark.parametrize("field", ["linear_acceleration", "angular_velocity", "orientation"])
def test_an_imu_that_measures_no_number_is_refused(field: str) -> None:
    broken = SimpleNamespace(x=0.0, y=float("nan"), z=0.0, w=0.0)
    with pytest.raises(ValueError, match="ImuSample: expected finite"):
        motion_from_msg.imu(imu(**{field: broken, "orientation_covariance": np.full(9, 1e-4)}))


def test_gravity_between_two_samples_is_between_theirs_and_as_sure_as_the_less_sure() -> None:
    def felt(stamp_ns: int, degrees: float, sigma_deg: float, frame_id: str = "imu") -> FeltGravity:
        gravity = np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees)), 0.0])
        return FeltGravity(gravity=gravity, gravity_sigma_deg=sigma_deg, stamp_ns=stamp_ns, frame_id=frame_id)

    between = motion_from_msg.gravity_at(15, (felt(10, 0.0, 1.0), felt(20, 4.0, 2.0)))
    assert between.gravity == pytest.approx(felt(15, 2.0, 2.0).gravity)
    assert (between.gravity_sigma_deg, between.stamp_ns) == (2.0, 15)
    alone = felt(10, 0.0, 1.0)
    assert motion_from_msg.gravity_at(15, (alone,)) is alone
    other = felt(20, 4.0, 2.0, "another")
    assert motion_from_msg.gravity_at(18, (alone, other)) is other


def test_a_stamped_pose_and_a_transform_are_odometry_too() -> None:
    full = messages.odometry(at=(1, 2, 3))
    stamped = SimpleNamespace(header=full.header, pose=full.pose.pose)
    transform = SimpleNamespace(translation=full.pose.pose.position, rotation=full.pose.pose.orientation)
    moved = SimpleNamespace(header=full.header, child_frame_id="camera", transform=transform)
    for message in (stamped, moved):
        assert motion_from_msg.odometry(message).T_odom_body[:3, 3].tolist() == [1, 2, 3]


def test_a_pose_without_a_rotation_is_refused() -> None:
    with pytest.raises(ValueError, match="quaternion"):
        motion_from_msg.odometry(messages.odometry((0, 0, 0, 0)))


def test_a_constraint_names_its_two_moments() -> None:
    message = messages.odometry(at=(0.1, 0, 0), frame_id="camera@12.000000034")
    message.child_frame_id = "rear@99.500000000"
    closure = from_msg.loop_closure(message)
    assert (closure.from_ns, closure.to_ns) == (12_000_000_034, 99_500_000_000)
    assert (closure.from_frame_id, closure.to_frame_id) == ("camera", "rear")
    assert closure.T_from_to[0, 3] == 0.1 and np.array_equal(closure.covariance, np.eye(6))


@pytest.mark.parametrize("name", ["camera", "camera@12", "camera@12.34", "camera@x.000000001", ""])
def test_a_frame_without_a_moment_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"camera@12.000000034"):
        from_msg.moment(name)


@pytest.mark.parametrize(
    "name", ["camera@" + "9" * 4000 + ".000000000", "camera@9999999999.000000000", "camera@2147483648.000000000"]
)
def test_a_moment_that_no_stamp_can_hold_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        from_msg.moment(name)
    message = messages.odometry(frame_id="camera@12.000000034")
    message.child_frame_id = name
    with pytest.raises(ValueError, match="expected"):
        from_msg.loop_closure(message)


@pytest.mark.parametrize(
    ("sec", "nanosec", "complaint"),
    [(2**31, 0, "seconds of 32 bits, got 2147483648"), (5, 10**9, "nanoseconds below 1000000000, got 1000000000")],
)
def test_a_stamp_that_no_message_can_carry_is_refused(sec: int, nanosec: int, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        headers.stamp_ns(SimpleNamespace(sec=sec, nanosec=nanosec))


def test_the_first_and_the_last_stamp_there_is_are_stamps() -> None:
    assert headers.stamp_ns(SimpleNamespace(sec=-(2**31), nanosec=0)) == -(2**31) * 10**9
    assert from_msg.moment("camera@2147483647.999999999") == ("camera", 2**31 * 10**9 - 1)


def test_a_name_beyond_all_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="child_frame_id: expected at most 1000 characters, got 1001"):
        message = messages.odometry()
        message.child_frame_id = "x" * 1001
        motion_from_msg.odometry(message)
    with pytest.raises(ValueError, match="frame_id: expected at most 1000 characters, got 2000"):
        motion_from_msg.odometry(messages.odometry(frame_id="y" * 2000))


def test_a_frame_may_have_an_at_sign_in_its_name() -> None:
    assert from_msg.moment("robot@home/camera@0.000000007") == ("robot@home/camera", 7)


def test_a_camera_without_a_name_has_moments_too() -> None:
    assert from_msg.moment("@1.000000007") == ("", 1_000_000_007)


def test_a_moment_before_time_zero_is_a_moment() -> None:
    assert from_msg.moment("camera@-2.750000000") == ("camera", -1_250_000_000)


def test_labels_are_json() -> None:
    assert from_msg.labels(SimpleNamespace(data=json.dumps({"3": "cup"}))) == {3: "cup"}


@pytest.mark.parametrize(
    "text",
    [
        "", "cup", "[1]", '{"a": "cup"}', '{"70000": "cup", "0": "cup"}', '{"65535": "cup"}', '{"-1": "cup"}',
        '{"0": 5}', '{"0": ["cup"]}', '{"0": "\\ud800"}', '{"1e400": "cup"}',
        pytest.param("[" * 100_000, id="deep"), pytest.param('{"0": "' + "x" * 1001 + '"}', id="long"),
        pytest.param('{"' + "9" * 5000 + '": "cup"}', id="many digits"),
    ],
)  # fmt: skip
def test_labels_of_another_shape_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="labels: expected JSON"):
        from_msg.labels(SimpleNamespace(data=text))


def test_a_table_of_labels_beyond_all_sense_is_refused_unread() -> None:
    with pytest.raises(ValueError, match="labels: expected at most 4000000 characters, got 5000000"):
        from_msg.labels(SimpleNamespace(data="x" * 5_000_000))


def test_a_table_of_detections_comes_best_first() -> None:
    rows = np.array([(1, 2, 30, 40, 0.5, 3, 64, 48), (5, 6, 7, 8, 0.75, 9, 64, 48)], DETECTIONS)
    found = from_msg.detections(messages.own_table(rows), {3: "cup"})
    assert found.label == ("9", "cup") and found.image_hw == (48, 64)
    assert found.xyxy[1].tolist() == [1, 2, 30, 40] and found.score.tolist() == [0.75, 0.5]


def test_detections_of_one_score_stay_in_their_order() -> None:
    scores = np.random.default_rng(1).choice([0.25, 0.5, 0.75], 400).tolist()
    rows = np.array([(k, 0, 500, 40, score, 3, 640, 480) for k, score in enumerate(scores)], DETECTIONS)
    order = sorted(range(400), key=lambda k: -scores[k])
    assert from_msg.detections(messages.own_table(rows), {}).xyxy[:, 0].tolist() == order


def test_an_empty_table_is_no_detection_of_the_size_at_hand() -> None:
    found = from_msg.detections(messages.own_table(np.zeros((1, 0), DETECTIONS)), {}, image_hw=(48, 64))
    assert len(found) == 0 and found.image_hw == (48, 64)


def retyped(rows: np.ndarray, **kinds: str) -> SimpleNamespace:
    """The message of rows of which some fields have other types."""
    layout = np.dtype([(name, kinds.get(name, rows.dtype[name].str)) for name in rows.dtype.names or ()])
    return messages.cloud(np.atleast_2d(rows.astype(layout)))


@pytest.mark.parametrize("field", ["image_height", "image_width", "class_id"])
def test_a_size_or_class_that_is_no_whole_number_is_refused(field: str) -> None:
    rows = np.array([(1, 2, 30, 40, 0.5, 3, 64, 48)], DETECTIONS)
    message = retyped(rows.astype([(n, "<f4" if n == field else DETECTIONS[n].str) for n in DETECTIONS.names or ()]))
    with pytest.raises(ValueError, match=f"expected whole numbers in field '{field}', got float32"):
        from_msg.detections(message, {})


def test_a_size_beyond_16_bits_is_refused() -> None:
    message = retyped(np.array([(1, 2, 30, 40, 0.5, 3, 64, 48)], DETECTIONS), image_width="<u4")
    message.data = bytearray(message.data)
    np.ndarray(1, "<u4", message.data, 22)[:] = 2642833074
    with pytest.raises(ValueError, match="expected 0 to 65535 in field 'image_width', got 2642833074"):
        from_msg.detections(message, {})


def test_more_boxes_than_a_picture_has_things_are_refused() -> None:
    with pytest.raises(ValueError, match="detections: expected at most 1000 boxes, got 1001"):
        from_msg.detections(messages.own_table(np.zeros(1001, DETECTIONS)), {})


def test_a_depth_beyond_all_measure_is_none() -> None:
    message = messages.image(np.array([[1.5, 1e30], [np.inf, 100001.0]], np.float32), "32FC1")
    assert from_msg.depth(message).tolist() == [[1.5, 0.0], [0.0, 0.0]]


def object_rows() -> np.ndarray:
    rows = np.zeros(5, OBJECTS)
    rows["instance"] = [2, 0, 1, 2, 1]
    rows["class_id"] = [3, SUPPORT_ID, 4, 3, 4]
    rows["x"], rows["z"] = [20, 0, 10, 21, 11], 1
    rows["normal_z"], rows["score"], rows["density"], rows["flags"] = -1, 0.5, 1000, 5
    rows["rgb"] = 0x010203
    return rows


def test_objects_come_in_order_with_the_support_apart() -> None:
    clouds, support = from_msg.objects(messages.own_table(object_rows()), {3: "cup", 4: "box"})
    assert [(c.label, c.instance, c.xyz[:, 0].tolist()) for c in clouds] == [("box", 1, [10, 11]), ("cup", 2, [20, 21])]
    assert support is not None and support.label == "support" and len(support) == 1
    assert clouds[0].rgb is not None and clouds[0].rgb[0].tolist() == [1, 2, 3]
    assert (clouds[1].score, clouds[1].density, clouds[1].flags.tolist()) == (0.5, 1000.0, [5, 5])


@pytest.mark.parametrize("z", [0.0, -1.0, 1e-40, np.nan])
def test_a_point_that_no_camera_sees_is_refused(z: float) -> None:
    rows = object_rows()
    rows["z"][2] = z
    with pytest.raises(ValueError, match="objects: expected points in front of the camera"):
        from_msg.objects(messages.own_table(rows), {})


@pytest.mark.parametrize(
    ("field", "value"), [("score", np.nan), ("score", np.inf), ("score", 7.0), ("density", np.nan)]
)
def test_an_object_whose_numbers_mean_nothing_is_refused(field: str, value: float) -> None:
    rows = object_rows()
    rows[field] = value
    with pytest.raises(ValueError, match=f"expected a .*{field} of .*got {value}"):
        from_msg.objects(messages.own_table(rows), {})


@pytest.mark.parametrize(
    ("field", "value", "complaint"),
    [
        ("x", 3e38, "points of 'cup' within 1000 m"),
        ("normal_x", 1e30, "normals of 'cup' of length 1"),
        ("density", 1e20, "a density of 'cup'"),
    ],
)
def test_a_number_beyond_all_measure_ends_in_a_refusal(field: str, value: float, complaint: str) -> None:
    rows = object_rows()
    rows[field][0] = value
    with pytest.raises(ValueError, match=f"expected {complaint}"):
        from_msg.objects(messages.own_table(rows), {3: "cup"})


def test_more_objects_than_a_frame_has_are_refused() -> None:
    rows = np.repeat(object_rows()[:1], 700)
    rows["instance"] = np.arange(700)
    with pytest.raises(ValueError, match="objects: expected at most 500 objects, got 700"):
        from_msg.objects(messages.own_table(rows), {})


def test_a_view_of_more_pixels_than_any_is_refused() -> None:
    message, info = view_messages()
    message.width = message.height = 5000
    with pytest.raises(ValueError, match="view: expected at most 600000 pixels, got 5000 × 5000"):
        from_msg.view(message, info)


def test_a_camera_of_more_pixels_than_any_picture_projects_no_cloud() -> None:
    cloud = from_msg.point_cloud(messages.cloud(np.ones((1, 9), [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])))
    for size in (20_000, 1_000_000):
        info = messages.camera_info([500.0, 0, size / 2, 0, 500, size / 2, 0, 0, 1], size, size)
        with pytest.raises(ValueError, match="expected at most"):
            camera_from_msg.camera_of_cloud(info, cloud)


def test_no_objects_are_no_objects() -> None:
    assert from_msg.objects(messages.own_table(np.zeros((1, 0), OBJECTS)), {}) == ((), None)


def view_messages() -> tuple[SimpleNamespace, SimpleNamespace]:
    rows = np.zeros((3, 4), VIEW)
    rows["z"], rows["rgb"] = 2, 0x404040
    return messages.own_table(rows), messages.camera_info([5.0, 0, 1.5, 0, 5, 1, 0, 0, 1], 4, 3)


def gravity_message(x: float, y: float, z: float) -> SimpleNamespace:
    return SimpleNamespace(header=messages.header(), vector=messages.xyz(x, y, z))


def test_gravity_is_a_direction_and_no_more_than_certain() -> None:
    falls, confidence = from_msg.gravity(gravity_message(0, 3.0, 4.0))
    assert falls is not None and falls.tolist() == [0, 0.6, 0.8] and confidence == 1.0


def test_a_frame_is_made_of_its_four_messages() -> None:
    view, info = view_messages()
    frame = from_msg.frame(
        messages.own_table(object_rows()),
        view,
        info,
        gravity_message(0, 0.5, 0),
        {3: "cup"},
        [motion_from_msg.odometry(messages.odometry(at=(1, 0, 0)))],
    )
    assert [cloud.label for cloud in frame.objects] == ["4", "cup"]
    assert frame.view.grey is not None and frame.view.grey[0, 0] == 0x40
    assert frame.gravity is not None and frame.gravity.tolist() == [0, 1, 0] and frame.gravity_confidence == 0.5
    assert frame.T_odom_camera is not None and frame.T_odom_camera[0, 3] == 1


def test_the_camera_sits_where_the_body_carries_it() -> None:
    view, info = view_messages()
    T_body_camera = np.eye(4)
    T_body_camera[1, 3] = 2
    parts = (messages.own_table(object_rows()), view, info, gravity_message(0, 0, 0), {})
    half = np.sqrt(0.5)
    odometry = motion_from_msg.odometry(
        messages.odometry((0, 0, half, half), (1, 0, 0))
    )  # the body's y is back along odom's x
    frame = from_msg.frame(*parts, [odometry], T_body_camera)
    assert frame.T_odom_camera is not None and np.allclose(frame.T_odom_camera[:3, 3], (-1, 0, 0))
    assert frame.gravity is None and frame.gravity_confidence == 0


def test_a_pose_between_two_messages_is_between_theirs() -> None:
    around = [motion_from_msg.odometry(messages.odometry(at=(x, 0, 0), stamp_ns=60 + 40 * x)) for x in (1, 2)]
    np.testing.assert_allclose(motion_from_msg.pose_at(110, around)[:3, 3], (1.25, 0, 0))
    assert motion_from_msg.pose_at(110, around[:1])[0, 3] == 1
    assert motion_from_msg.pose_at(500, around)[0, 3] == 2 and motion_from_msg.pose_at(0, around)[0, 3] == 1


def test_there_is_nothing_between_poses_in_two_frames() -> None:
    around = [motion_from_msg.odometry(messages.odometry(at=(x, 0, 0), stamp_ns=100 * x)) for x in (1, 2)]
    around[1] = replace(around[1], frame_id="another")
    assert [motion_from_msg.pose_at(moment, around)[0, 3] for moment in (120, 180)] == [1, 2]


@pytest.mark.parametrize("other", range(4))
def test_messages_of_two_moments_are_no_frame(other: int) -> None:
    parts = [messages.own_table(object_rows()), *view_messages(), gravity_message(0, 1, 0)]
    parts[other].header = messages.header(stamp_ns=5)
    with pytest.raises(ValueError, match="of one stamp"):
        from_msg.frame(*parts, {})
