# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import numpy as np
import pytest

from objreg_ros import limits
from objreg_ros.data import closures, frames, images
from objreg_ros.data.closures import framed, robot_of
from objreg_ros.data.frames import PointFlag

NAN = np.float32(np.nan)
CAMERA = images.Intrinsics(fx=50.0, fy=60.0, cx=31.5, cy=23.5, width=64, height=48)


def floats(*shape: int) -> np.ndarray:
    return np.zeros(shape, np.float32)


def cloud(**changes: Any) -> frames.ObjectCloud:
    values = {"label": "cup", "score": 0.5, "instance": 1, "xyz": floats(4, 3), "normals": floats(4, 3), "rgb": None,
              "flags": np.zeros(4, np.uint16), "density": 1.0, **changes}  # fmt: skip
    return frames.ObjectCloud(**values)


def view(**changes: Any) -> frames.View:
    return frames.View(**{"xyz": 1.0 + floats(48, 64, 3), "grey": None, "intrinsics": CAMERA, **changes})


def frame(**changes: Any) -> frames.Frame:
    values = {"objects": (cloud(),), "support": None, "view": view(), "gravity": None, "gravity_confidence": 0.0,
              "T_odom_camera": None, "stamp_ns": 5, **changes}  # fmt: skip
    return frames.Frame(**values)


def detections(**changes: Any) -> images.Detections:
    values = {
        "xyxy": floats(2, 4),
        "score": floats(2),
        "label": ("a", "b"),
        "image_hw": (48, 64),
        "stamp_ns": 5,
        **changes,
    }
    return images.Detections(**values)


def closure(**changes: Any) -> closures.LoopClosure:
    values = {"from_ns": 1, "to_ns": 2, "T_from_to": np.eye(4), "covariance": np.eye(6), "labels": (), **changes}
    return closures.LoopClosure(**values)


def alignment(**changes: Any) -> closures.Alignment:
    values = {"T_target_source": np.eye(4), "information": np.eye(6), "inliers": 3, "overlap": 0.5, "rmse": 0.1,
              "converged": True, **changes}  # fmt: skip
    return closures.Alignment(**values)


def depth_image(**changes: Any) -> images.DepthImage:
    return images.DepthImage(**{"depth": floats(48, 64), "rgb": None, "intrinsics": CAMERA, "stamp_ns": 5, **changes})


def point_cloud(**changes: Any) -> images.PointCloud:
    return images.PointCloud(**{"xyz": floats(1, 7, 3), "rgb": None, "stamp_ns": 5, **changes})


MAKERS = (cloud, view, frame, detections, closure, alignment, depth_image, point_cloud)


@pytest.mark.parametrize("make", MAKERS)
def test_a_value_is_frozen_and_its_arrays_are_read_only(make: Any) -> None:
    made = make()
    values = {part.name: getattr(made, part.name) for part in fields(made)}
    with pytest.raises(FrozenInstanceError):
        setattr(made, next(iter(values)), None)
    for array in (value for value in values.values() if isinstance(value, np.ndarray) and value.size):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1


def test_the_array_that_was_given_stays_writable() -> None:
    xyz = floats(4, 3)
    made = cloud(xyz=xyz)
    xyz[0, 0] = 7
    assert made.xyz[0, 0] == 7  # a view: nothing was copied


def far(metres: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = metres
    return T


R_MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])
R_SCALED = np.diag([1.1, 1.1, 1.1, 1.0])
NOT_POSITIVE = np.diag([1.0, 1, 1, 1, 1, 0])
NOT_SYMMETRIC = np.eye(6) + np.eye(6, k=1)


@pytest.mark.parametrize(
    ("make", "changes", "complaint"),
    [
        (cloud, {"xyz": np.zeros((4, 3))}, ".xyz: expected float32 of shape (M, 3), got float64 of shape (4, 3)"),
        (cloud, {"xyz": floats(4, 2)}, "got float32 of shape (4, 2)"),
        (cloud, {"xyz": [[0, 0, 0]]}, "got list"),
        (cloud, {"normals": floats(3, 3)}, "ObjectCloud.normals: expected float32 of shape (M, 3) with {'M': 4}"),
        (cloud, {"flags": np.zeros(4, np.int64)}, "ObjectCloud.flags: expected uint16"),
        (cloud, {"rgb": np.zeros((4, 3), np.float32)}, "ObjectCloud.rgb: expected uint8"),
        (cloud, {"xyz": np.full((4, 3), NAN)}, "expected finite points of 'cup'"),
        (cloud, {"score": NAN}, "ObjectCloud: expected a score of 'cup' in 0..1, got nan"),
        (cloud, {"score": np.inf}, "expected a score of 'cup' in 0..1, got inf"),
        (cloud, {"score": -0.1}, "expected a score of 'cup' in 0..1, got -0.1"),
        (cloud, {"density": NAN}, "expected a density of 'cup' of 0 to 1e+12, got nan"),
        (cloud, {"density": np.inf}, "expected a density of 'cup' of 0 to 1e+12, got inf"),
        (cloud, {"density": 1e13}, "expected a density of 'cup' of 0 to 1e+12, got 10000000000000.0"),
        (cloud, {"xyz": floats(4, 3) + 3e38}, "expected points of 'cup' within 1000 m, got 3e+38 m"),
        (cloud, {"xyz": floats(4, 3) - 1001}, "expected points of 'cup' within 1000 m, got 1001 m"),
        (cloud, {"normals": floats(4, 3) + 1e30}, "expected normals of 'cup' of length 1 or 0, got a part of 1e+30"),
        (cloud, {"normals": np.full((4, 3), NAN)}, "expected normals of 'cup' of length 1 or 0, got a part of nan"),
        (cloud, {"label": "x" * 1001}, "expected a label of at most 1000 characters"),
        (view, {"xyz": floats(48, 64, 3) - 1001}, "View: expected points within 1000 m, got 1001 m"),
        (frame, {"T_odom_camera": far(1.1e8)}, "Frame: expected T_odom_camera within 1e+08 m, got 1.1e+08 m"),
        (depth_image, {"depth": np.full((48, 64), NAN)}, "expected depth of 0 to 100000 m, got nan to nan m"),
        (depth_image, {"depth": floats(48, 64) - 1}, "expected depth of 0 to 100000 m, got -1 to -1 m"),
        (depth_image, {"depth": floats(48, 64) + 1e30}, "expected depth of 0 to 100000 m, got 1e+30 to 1e+30 m"),
        (cloud, {"label": "\ud800cup"}, r"expected a label that UTF-8 can write, got '\ud800cup'"),
        (view, {"xyz": floats(24, 64, 3)}, "View.xyz: expected float32 of shape (h, w, 3)"),
        (view, {"grey": np.zeros((48, 64, 3), np.uint8)}, "View.grey: expected uint8 of shape (h, w)"),
        (frame, {"gravity": np.array([0, 2.0, 0])}, "expected gravity of length 1, got 2.0"),
        (frame, {"gravity": floats(3)}, "Frame.gravity: expected float64 of shape (3,)"),
        (frame, {"T_odom_camera": R_MIRRORED}, "Frame.T_odom_camera: expected a rigid motion"),
        (frame, {"T_odom_camera": np.full((4, 4), np.nan)}, "expected a rigid motion"),
        (detections, {"instances": floats(3, 4)}, "Detections.instances: expected uint16 of shape (any, any)"),
        (detections, {"instances": np.zeros((0, 4), np.uint16)}, "Detections: expected instances of a size above 0 px"),
        (detections, {"score": floats(3)}, "Detections.score: expected float32 of shape (N,) with {'N': 2}"),
        (detections, {"xyxy": np.full((2, 4), NAN)}, "expected finite boxes"),
        (detections, {"score": np.array([0.5, 1.5], np.float32)}, "expected scores in 0..1"),
        (detections, {"score": np.full(2, NAN)}, "expected scores in 0..1"),
        (detections, {"image_hw": (0, 64)}, "expected an image size above 0 px"),
        (closure, {"T_from_to": R_SCALED}, "LoopClosure.T_from_to: expected a rigid motion"),
        (closure, {"covariance": NOT_POSITIVE}, "expected a positive definite covariance"),
        (closure, {"covariance": 1e-300 * np.eye(6)}, "expected a positive definite covariance"),
        (closure, {"covariance": NOT_SYMMETRIC}, "expected a finite, symmetric covariance"),
        (closure, {"covariance": np.full((6, 6), np.nan)}, "expected a finite, symmetric covariance"),
        (closure, {"covariance": np.eye(3)}, "LoopClosure.covariance: expected float64 of shape (6, 6)"),
        (alignment, {"degenerate": np.zeros((1, 3))}, "Alignment.degenerate: expected float64 of shape (any, 6)"),
        (depth_image, {"depth": floats(64, 48)}, "DepthImage.depth: expected float32 of shape (H, W)"),
        (depth_image, {"rgb": np.zeros((24, 32, 3), np.uint8)}, "DepthImage.rgb: expected uint8 of shape (H, W, 3)"),
        (point_cloud, {"rgb": np.zeros((7, 1, 3), np.uint8)}, "PointCloud.rgb: expected uint8 of shape (H, W, 3)"),
    ],
)  # fmt: skip
def test_a_broken_value_is_refused_with_expected_and_got(make: Any, changes: dict, complaint: str) -> None:
    with pytest.raises(ValueError) as refused:
        make(**changes)
    assert complaint in str(refused.value)


@pytest.mark.parametrize(
    "change",
    [
        *({"fx": 0.0}, {"fy": -1.0}, {"cx": NAN}, {"width": 0}, {"height": -3}, {"fx": np.inf}),
        *({"fx": 1e-300}, {"fy": 1e-30}, {"fx": 1e300}, {"cx": 1e30}, {"cy": -1e9}),
    ],
)
def test_a_camera_that_cannot_be_is_refused(change: dict) -> None:
    with pytest.raises(ValueError, match="Intrinsics: expected"):
        replace(CAMERA, **change)


@pytest.mark.parametrize("step", [1, 2, 3, 4, 5])
def test_a_reduced_camera_sees_the_rays_of_the_pixels_that_it_keeps(step: int) -> None:
    small = CAMERA.scaled(step)
    columns, rows = np.arange(CAMERA.width)[step // 2 :: step], np.arange(CAMERA.height)[step // 2 :: step]
    assert (small.width, small.height) == (len(columns), len(rows))
    assert np.allclose((np.arange(small.width) - small.cx) / small.fx, (columns - CAMERA.cx) / CAMERA.fx)
    assert np.allclose((np.arange(small.height) - small.cy) / small.fy, (rows - CAMERA.cy) / CAMERA.fy)


@pytest.mark.parametrize("T", [R_MIRRORED, R_SCALED, np.full((4, 4), np.nan), np.eye(3)])
def test_an_odometry_that_is_no_rigid_motion_is_refused(T: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"Odometry\.T_odom_body: expected"):
        frames.Odometry(T_odom_body=T, stamp_ns=5)


def test_each_flag_of_a_point_is_the_bit_that_stores_and_messages_have_for_it() -> None:
    bits = {"EDGE": 1, "CUT_BY_IMAGE": 2, "CUT_BY_BOX": 4, "WALL_LIKE": 8, "UNSUPPORTED": 16}
    assert {flag.name: int(flag) for flag in PointFlag} == bits


def test_no_objects_and_no_points_are_allowed() -> None:
    nothing = detections(xyxy=floats(0, 4), score=floats(0), label=())
    empty = cloud(xyz=floats(0, 3), normals=floats(0, 3), flags=np.zeros(0, np.uint16))
    assert len(nothing) == len(empty) == 0 and frame(objects=()).objects == ()


def test_an_object_has_a_flag_when_all_its_points_have_it() -> None:
    both = np.full(4, PointFlag.CUT_BY_BOX | PointFlag.WALL_LIKE, np.uint16)
    some = both.copy()
    some[0] = PointFlag.WALL_LIKE
    assert cloud(flags=both).has(PointFlag.CUT_BY_BOX) and cloud(flags=some).has(PointFlag.WALL_LIKE)
    assert not cloud(flags=some).has(PointFlag.CUT_BY_BOX) and not cloud(flags=both).has(PointFlag.EDGE)
    empty = cloud(xyz=floats(0, 3), normals=floats(0, 3), flags=np.zeros(0, np.uint16))
    assert not empty.has(PointFlag.EDGE)


def test_a_cloud_of_one_row_is_not_organised() -> None:
    assert not point_cloud().organised and point_cloud(xyz=floats(2, 3, 3)).organised


def test_values_are_compared_by_identity() -> None:
    assert closure() != closure()


def test_an_almost_symmetric_covariance_is_good_enough() -> None:
    covariance = np.eye(6)
    covariance[0, 1] = 1e-9
    assert closure(covariance=covariance).covariance[0, 1] == 1e-9


def test_a_view_may_have_points_that_were_not_measured() -> None:
    assert np.isnan(view(xyz=np.full((48, 64, 3), NAN)).xyz).all()


def test_a_camera_of_more_pixels_than_any_picture_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected at most 500000000 pixels, got \(1000000, 1000000\)"):
        images.Intrinsics(fx=500.0, fy=500.0, cx=0.0, cy=0.0, width=10**6, height=10**6)


def test_a_view_that_no_registrar_would_take_is_refused_where_it_is_made() -> None:
    camera = images.Intrinsics(fx=50.0, fy=50.0, cx=40.0, cy=30000.0, width=80, height=60000)
    with pytest.raises(ValueError, match=r"View: expected at most 600000 pixels, got \(80, 60000\)"):
        frames.View(xyz=np.zeros((60000, 80, 3), np.float32), grey=None, intrinsics=camera)


@pytest.mark.parametrize("nearest", [0.0, 1e-9, 9e-4, -1.0])
def test_a_view_has_nothing_nearer_than_a_millimetre(nearest: float) -> None:
    xyz = 1.0 + floats(48, 64, 3)
    xyz[3, 4, 2] = nearest
    with pytest.raises(ValueError, match=r"View: expected points at z = 0\.001 m or farther"):
        view(xyz=xyz)
    xyz[3, 4] = np.nan, np.nan, limits.LEAST_RANGE
    xyz[5] = np.nan
    assert np.isnan(view(xyz=xyz).xyz[5]).all() and view(xyz=np.full_like(xyz, np.nan)).xyz.shape == xyz.shape


def test_a_place_in_an_earlier_map_has_rigid_poses_and_a_finite_covariance() -> None:
    good = {"T_map_odom": np.eye(4), "T_map_camera": np.eye(4), "covariance": np.eye(6)}
    assert closures.Relocalised(stamp_ns=1, session=0, target_ns=0, closures=2, **good).covariance.shape == (6, 6)
    for name, bad in (("T_map_odom", 2 * np.eye(4)), ("covariance", np.full((6, 6), np.nan))):
        with pytest.raises(ValueError, match="Relocalised"):
            closures.Relocalised(stamp_ns=1, session=0, target_ns=0, closures=2, **good | {name: bad})


def test_a_picture_of_instances_is_shown_in_another_size_by_the_nearest_pixel() -> None:
    numbers = np.arange(12, dtype=np.uint16).reshape(3, 4)
    one = detections(instances=numbers)
    assert one.instances_at((3, 4)) is one.instances and detections().instances_at((3, 4)) is None
    np.testing.assert_array_equal(one.instances_at((6, 8)), numbers.repeat(2, axis=0).repeat(2, axis=1))
    np.testing.assert_array_equal(one.instances_at((1, 4)), numbers[1:2])
    np.testing.assert_array_equal(detections(instances=numbers.repeat(3, 0).repeat(3, 1)).instances_at((3, 4)), numbers)


def test_a_box_touches_the_pixels_that_it_covers_in_part_and_none_outside_the_picture() -> None:
    xyxy = np.array([[1.2, 2.0, 3.1, 4.0], [-5, 40, 1e30, 60], [70, -9, 80, -3]], np.float32)
    three = detections(xyxy=xyxy, score=floats(3), label=("a", "b", "c"))
    assert [three.touched(k) for k in range(3)] == [
        (slice(2, 4), slice(1, 4)), (slice(40, 48), slice(0, 64)), (slice(0, 0), slice(64, 64))
    ]  # fmt: skip


def test_robots_may_be_the_same_as_far_as_both_are_known() -> None:
    one = closure(from_robot="a", to_robot="b")
    assert one.robots == ("a", "b") and closure().robots == ("", "")
    assert closures.may_be_same(one.robots, ("", "")) and closures.may_be_same(one.robots, ("a", ""))
    assert not closures.may_be_same(one.robots, ("a", "a")) and one.moments == closure().moments


def test_a_frame_gets_the_prefix_of_its_robot_once() -> None:
    assert framed("r1", "camera") == framed("r1", "r1/camera") == "r1/camera"
    assert framed("", "camera") == "camera"
    assert framed("r1", "r10/camera") == "r1/r10/camera"


def test_a_frame_names_its_robot_by_the_longest_name() -> None:
    robots = ["r1", "fleet", "fleet/r1"]
    found = [robot_of(frame_id, robots) for frame_id in ("r1/camera", "fleet/r1/camera", "r10/camera", "camera")]
    assert found == ["r1", "fleet/r1", "", ""]


def test_a_refusal_of_a_closure_has_every_field_that_they_share() -> None:
    closure = closures.LoopClosure(
        from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",), evidence={"odds": 3.0},
        from_frame_id="front", to_frame_id="rear", from_session=4, to_session=5, from_robot="a", to_robot="b",
    )  # fmt: skip
    one = closures.refused(closure, closures.Reason.SLACK, "along x")
    assert (one.reason, one.detail) == (closures.Reason.SLACK, "along x")
    shared = {field.name for field in fields(one)} & {field.name for field in fields(closure)}
    assert len(shared) == 10 and all(getattr(one, name) is getattr(closure, name) for name in shared)
