# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from array import array
from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers, motion_from_msg, to_msg
from objreg_ros.bridge.messages.layout import OBJECTS, SUPPORT_ID, UNNAMED_ID, table
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Observation
from objreg_ros.data.frames import UNNAMED, Frame, ObjectCloud, Odometry, PointFlag, View
from objreg_ros.data.images import ColourImage, DepthImage, Detections, Intrinsics, PointCloud
from objreg_ros.geometry import pose, rotation_from_vector

STAMP = 1_700_000_000_123_456_789
NAMES = {0: "cup", 7: "tv", 9: "cup"}
CAMERA = Intrinsics(fx=525.0, fy=524.5, cx=3.25, cy=2.5, width=8, height=6)
RNG = np.random.default_rng(4)


def cloud_of(label: str, instance: int, count: int, coloured: bool = True) -> ObjectCloud:
    xyz = RNG.normal(size=(count, 3)).astype(np.float32)
    xyz[:, 2] = 1 + np.abs(xyz[:, 2])
    normals = RNG.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return ObjectCloud(
        label=label,
        score=float(np.float32(0.75)),
        instance=instance,
        xyz=xyz,
        normals=normals.astype(np.float32),
        rgb=RNG.integers(0, 256, (count, 3), dtype=np.uint8) if coloured else None,
        flags=np.full(count, PointFlag.EDGE | PointFlag.CUT_BY_BOX, np.uint16),
        density=float(np.float32(12345.5)),
    )


def frame_of(*objects: ObjectCloud, support: ObjectCloud | None = None, grey: bool = True) -> Frame:
    xyz = RNG.normal(size=(6, 8, 3)).astype(np.float32)
    xyz[..., 2] = np.abs(xyz[..., 2]) + np.float32(0.1)
    xyz[0, 0] = np.nan
    return Frame(
        objects=objects,
        support=support,
        view=View(xyz=xyz, grey=RNG.integers(0, 256, (6, 8), dtype=np.uint8) if grey else None, intrinsics=CAMERA),
        gravity=np.array([0.0, 0.6, 0.8]),
        gravity_confidence=0.5,
        T_odom_camera=None,
        stamp_ns=STAMP,
        frame_id="kinect",
    )


def closure(*matches: ObjectMatch) -> LoopClosure:
    A = RNG.normal(size=(6, 6))
    return LoopClosure(
        from_ns=5,
        to_ns=STAMP,
        T_from_to=pose(rotation_from_vector(np.array([0.1, -2.0, 0.3])), np.array([1.0, 2.0, 3.0])),
        covariance=A @ A.T + np.eye(6),
        labels=("cup",),
        objects=matches,
        from_frame_id="front",
        to_frame_id="kinect",
    )


def test_a_stamp_survives_to_the_nanosecond() -> None:
    assert headers.stamp_ns(to_msg.header(STAMP, "kinect")) == STAMP
    assert headers.stamp_ns(to_msg.clock(STAMP).clock) == STAMP


def test_a_colour_image_comes_back_as_it_was() -> None:
    rgb = RNG.integers(0, 256, (5, 7, 3), dtype=np.uint8)
    for pixels in (rgb, rgb[:, ::-1], rgb[::-1]):  # contiguous and not
        message = to_msg.image(ColourImage(rgb=pixels, stamp_ns=STAMP, frame_id="kinect"))
        assert (message.step, len(message.data)) == (3 * 7, 5 * 3 * 7)
        back = from_msg.image(message)
        assert np.array_equal(back.rgb, pixels) and (back.stamp_ns, back.frame_id) == (STAMP, "kinect")


def test_messages_are_filled_with_bytes_and_not_element_by_element() -> None:
    message = to_msg.image(ColourImage(rgb=np.zeros((5, 7, 3), np.uint8), stamp_ns=0))
    assert isinstance(message.data, array) and message.data.typecode == "B"


def test_depth_comes_back_exactly_in_metres_and_to_half_a_millimetre_in_16_bits() -> None:
    depth = RNG.uniform(0.3, 4.0, (6, 8)).astype(np.float32)
    depth[0, 0], depth[0, 1] = 0, 100.0  # 100 m does not fit 16 bits of millimetres
    image = DepthImage(depth=depth, rgb=None, intrinsics=CAMERA, stamp_ns=STAMP)
    assert np.array_equal(from_msg.depth(to_msg.depth_image(image)), depth)
    millimetres = from_msg.depth(to_msg.depth_image(image, millimetres=True))
    assert millimetres[0, 0] == 0 and millimetres[0, 1] == 0
    assert np.abs(millimetres - depth)[1:].max() <= 0.00051


def test_a_camera_comes_back_as_it_was() -> None:
    info = to_msg.camera_info(CAMERA, STAMP, "kinect")
    back = camera_from_msg.intrinsics(info)
    assert (back.fx, back.fy, back.cx, back.cy, back.width, back.height) == (525.0, 524.5, 3.25, 2.5, 8, 6)
    assert np.array_equal(info.p.reshape(3, 4)[:, :3], info.k.reshape(3, 3)) and not info.p.reshape(3, 4)[:, 3].any()
    assert np.array_equal(info.r.reshape(3, 3), np.eye(3)) and not np.any(info.d)


@pytest.mark.parametrize("coloured", [True, False])
def test_a_cloud_comes_back_with_its_holes_and_with_colour_only_if_it_had_some(coloured: bool) -> None:
    xyz = RNG.normal(size=(6, 8, 3)).astype(np.float32)
    xyz[..., 2] = np.abs(xyz[..., 2]) + np.float32(0.1)
    xyz[2, 3] = np.nan
    rgb = RNG.integers(0, 256, (6, 8, 3), dtype=np.uint8) if coloured else None
    message = to_msg.points(PointCloud(xyz=xyz, rgb=rgb, stamp_ns=STAMP))
    back = from_msg.point_cloud(message)
    assert np.array_equal(back.xyz, xyz, equal_nan=True) and not message.is_dense
    assert np.array_equal(back.rgb, rgb) if coloured else back.rgb is None


def test_detections_come_back_with_their_names() -> None:
    detections = Detections(
        xyxy=np.array([[1, 2, 30.5, 40], [5, 6, 7, 8]], np.float32),
        score=np.array([0.9, 0.4], np.float32),
        label=("tv", "cup"),
        image_hw=(480, 640),
        stamp_ns=STAMP,
        frame_id="kinect",
    )
    message = to_msg.detections_table(detections, NAMES)
    assert table(message)["class_id"].tolist() == [[7, 0]]  # the first of two ids of one name
    back = from_msg.detections(message, NAMES)
    assert np.array_equal(back.xyxy, detections.xyxy) and np.array_equal(back.score, detections.score)
    assert (back.label, back.image_hw, back.stamp_ns) == (("tv", "cup"), (480, 640), STAMP)


def test_no_detection_gives_an_empty_table_with_the_header_of_the_image() -> None:
    empty = np.zeros((0, 4), np.float32)
    detections = Detections(
        xyxy=empty, score=empty[:, 0], label=(), image_hw=(480, 640), stamp_ns=STAMP, frame_id="kinect"
    )
    message = to_msg.detections_table(detections, NAMES)
    assert message.width == 0 and message.header.frame_id == "kinect"
    assert len(from_msg.detections(message, NAMES)) == 0


def test_the_table_of_a_surplus_picture_says_so_and_no_other_does() -> None:
    message = to_msg.surplus(STAMP, "kinect")
    assert from_msg.is_surplus(message) and headers.stamp_ns(message) == STAMP
    assert (message.header.frame_id, message.width, len(message.data)) == ("kinect", 0, 0)
    assert not from_msg.is_surplus(to_msg.PointCloud2())
    empty = np.zeros((0, 4), np.float32)
    none = Detections(xyxy=empty, score=empty[:, 0], label=(), image_hw=(480, 640), stamp_ns=STAMP)
    assert not from_msg.is_surplus(to_msg.detections_table(none, NAMES))


def test_a_label_that_was_not_published_is_refused_with_its_name() -> None:
    with pytest.raises(ValueError, match=r"'dog'.*2 published labels"):
        to_msg.objects(frame_of(cloud_of("dog", 1, 3)), NAMES)


def test_a_number_that_means_the_support_is_no_label() -> None:
    with pytest.raises(ValueError, match=f"'{SUPPORT_ID}'"):
        to_msg.objects(frame_of(cloud_of(str(SUPPORT_ID), 1, 3)), NAMES)


def test_an_object_without_a_name_travels_under_a_number_of_its_own() -> None:
    message = to_msg.objects(frame_of(cloud_of(UNNAMED, 1, 3)), NAMES)
    assert set(table(message, "class_id").ravel()["class_id"].tolist()) == {UNNAMED_ID}
    objects, _ = from_msg.objects(message, {})
    assert objects[0].label == UNNAMED


def test_a_class_without_a_name_keeps_its_number() -> None:
    objects, _ = from_msg.objects(to_msg.objects(frame_of(cloud_of("17", 1, 3)), NAMES), NAMES)
    assert objects[0].label == "17"


@pytest.mark.parametrize("coloured", [True, False])
def test_objects_and_their_support_come_back_as_they_were(coloured: bool) -> None:
    sent = frame_of(
        cloud_of("cup", 1, 5, coloured), cloud_of("tv", 2, 4, coloured), support=cloud_of("support", 0, 7, coloured)
    )
    objects, support = from_msg.objects(to_msg.objects(sent, NAMES), NAMES)
    assert support is not None and [o.label for o in objects] == ["cup", "tv"]
    for back, cloud in zip((support, *objects), (sent.support, *sent.objects), strict=True):
        assert cloud is not None
        for name in ("xyz", "normals", "flags"):
            assert np.array_equal(getattr(back, name), getattr(cloud, name)), name
        assert np.array_equal(back.rgb, cloud.rgb) if coloured else back.rgb is None
        assert (back.score, back.density, back.instance) == (cloud.score, cloud.density, cloud.instance)


def test_a_frame_without_objects_is_a_message_without_points() -> None:
    message = to_msg.objects(frame_of(), NAMES)
    assert message.width == 0 and from_msg.objects(message, NAMES) == ((), None)


def test_the_objects_cloud_has_the_fields_of_the_wire() -> None:
    message = to_msg.objects(frame_of(cloud_of("cup", 1, 2)), NAMES)
    assert tuple(field.name for field in message.fields) == OBJECTS.names
    assert message.row_step == 2 * message.point_step == len(message.data)


@pytest.mark.parametrize("grey", [True, False])
def test_the_view_comes_back_as_it_was(grey: bool) -> None:
    sent = frame_of(grey=grey)
    back = from_msg.view(to_msg.view(sent), to_msg.view_camera_info(sent))
    assert np.array_equal(back.xyz, sent.view.xyz, equal_nan=True)
    assert np.array_equal(back.grey, sent.view.grey) if grey else back.grey is None
    assert back.intrinsics.cx == CAMERA.cx


def test_gravity_carries_its_confidence_as_its_length() -> None:
    falls, confidence = from_msg.gravity(to_msg.gravity(frame_of()))
    assert falls == pytest.approx([0.0, 0.6, 0.8]) and confidence == pytest.approx(0.5)


def test_gravity_that_is_unknown_is_a_vector_without_length() -> None:
    message = to_msg.gravity(replace(frame_of(), gravity=None, gravity_confidence=0.0))
    assert (message.vector.x, message.vector.y, message.vector.z) == (0, 0, 0)
    assert from_msg.gravity(message) == (None, 0.0)


@pytest.mark.parametrize("axis", range(3))
def test_a_cloud_is_dense_only_where_every_axis_of_every_point_is_known(axis: int) -> None:
    xyz = np.ones((2, 3, 3), np.float32)
    assert to_msg.points(PointCloud(xyz=xyz, rgb=None, stamp_ns=STAMP)).is_dense
    xyz[1, 1, axis] = np.nan
    assert not to_msg.points(PointCloud(xyz=xyz, rgb=None, stamp_ns=STAMP)).is_dense


def test_a_constraint_comes_back_with_both_moments_and_its_covariance() -> None:
    sent = closure()
    message = to_msg.constraint(sent)
    assert message.header.frame_id == "front@0.000000005"
    assert message.child_frame_id == "kinect@1700000000.123456789"
    assert headers.stamp_ns(message) == STAMP
    back = from_msg.loop_closure(message)
    assert (back.from_ns, back.to_ns, back.from_frame_id, back.to_frame_id) == (5, STAMP, "front", "kinect")
    assert np.allclose(back.T_from_to, sent.T_from_to, atol=1e-12) and np.array_equal(back.covariance, sent.covariance)


def test_each_object_of_a_closure_is_one_transform_that_names_it() -> None:
    sent = closure(ObjectMatch(label="cup", object_id=3), ObjectMatch(label="cup", object_id=8))
    messages = to_msg.transforms(sent)
    assert [m.child_frame_id for m in messages] == [f"kinect@1700000000.123456789/cup_{n}" for n in (3, 8)]
    assert all(np.allclose(motion_from_msg.odometry(m).T_odom_body, sent.T_from_to, atol=1e-12) for m in messages)
    assert {(headers.stamp_ns(m), m.header.frame_id) for m in messages} == {(STAMP, "front@0.000000005")}


def test_landmarks_state_where_each_object_of_a_keyframe_was_and_which_it_is() -> None:
    seen = [
        Observation(label=label, object_id=k, xyz=np.array([k, 0.5, 2.0])) for k, label in ((7, "cup"), (9, "book"))
    ]
    message = to_msg.landmarks(seen, STAMP, "kinect", {4: "book", 6: "cup"})
    records = table(message, "object_id", "class_id")[0]
    assert (headers.stamp_ns(message), message.header.frame_id) == (STAMP, "kinect")
    assert records["object_id"].tolist() == [7, 9] and records["class_id"].tolist() == [6, 4]
    assert np.allclose([records[axis] for axis in "xyz"], [[7, 9], [0.5, 0.5], [2, 2]])
    (left,) = table(to_msg.landmarks(seen, STAMP, "kinect", {3: "book"}), "object_id", "class_id")
    assert left["object_id"].tolist() == [9], "cup is of a model that is no longer there"


def test_a_path_keeps_the_time_and_the_place_of_each_pose() -> None:
    T = pose(rotation_from_vector(np.array([0.0, 0.0, 0.5])), np.array([3.0, 2.0, 1.0]))
    message = to_msg.path([(STAMP, np.eye(4)), (STAMP + 5, T)], STAMP + 9, "map")
    assert [headers.stamp_ns(item) for item in (message, *message.poses)] == [STAMP + 9, STAMP, STAMP + 5]
    assert {item.header.frame_id for item in (message, *message.poses)} == {"map"}
    assert np.allclose(motion_from_msg.odometry(message.poses[1]).T_odom_body, T, atol=1e-12)


def test_odometry_comes_back_as_it_was() -> None:
    T = pose(rotation_from_vector(np.array([3.0, 0.5, 0.2])), np.array([3.0, 2.0, 1.0]))
    odometry = Odometry(T_odom_body=T, stamp_ns=STAMP, frame_id="world", child_frame_id="kinect")
    back = motion_from_msg.odometry(to_msg.odometry(odometry))
    assert np.allclose(back.T_odom_body, T, atol=1e-12)
    assert (back.stamp_ns, back.frame_id, back.child_frame_id) == (STAMP, "world", "kinect")


def test_labels_come_back_with_numbers_for_keys() -> None:
    message = to_msg.labels(NAMES)
    assert from_msg.labels(message) == NAMES and json.loads(message.data)["7"] == "tv"


def test_an_acknowledgement_names_the_node_the_frame_and_what_became_of_it() -> None:
    published, dropped = to_msg.finished("segmenter", STAMP), to_msg.finished("segmenter", STAMP, "unmatched")
    assert (published.frame_id, dropped.frame_id) == ("segmenter published", "segmenter dropped unmatched")
    assert headers.stamp_ns(published) == STAMP


def test_the_acknowledgement_of_a_frame_whose_keyframe_waits_says_that_it_was_followed() -> None:
    acknowledgement = to_msg.followed("registrar", STAMP)
    assert (acknowledgement.frame_id, headers.stamp_ns(acknowledgement)) == ("registrar followed", STAMP)


@pytest.mark.parametrize("stamp_ns", [-(2**31) * 10**9 - 1, 2**31 * 10**9])
def test_a_stamp_beyond_32_bits_of_seconds_is_refused_and_not_cut(stamp_ns: int) -> None:
    with pytest.raises(ValueError, match=f"expected seconds of 32 bits, got {stamp_ns} ns"):
        to_msg.stamp(stamp_ns)


def test_labels_of_ids_that_the_tables_cannot_carry_are_refused() -> None:
    with pytest.raises(ValueError, match="labels: expected ids of at most 65533, got 70000"):
        to_msg.labels({0: "cup", 70000: "tv"})
    assert json.loads(to_msg.labels({65533: "cup"}).data) == {"65533": "cup"}


def test_a_picture_that_is_too_long_for_the_table_is_refused() -> None:
    none = Detections(
        xyxy=np.zeros((0, 4), np.float32), score=np.zeros(0, np.float32), label=(), image_hw=(2, 65536), stamp_ns=5
    )
    with pytest.raises(ValueError, match=r"expected a picture of at most 65535 pixels a side, got \(2, 65536\)"):
        to_msg.detections_table(none, NAMES)
