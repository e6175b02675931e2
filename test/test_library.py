# SPDX-License-Identifier: Apache-2.0
"""What `import objreg_ros` offers, on a room of boxes whose poses are known to the last digit."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from registration import rooms

import objreg_ros
from objreg_ros import Camera, Registration, register, register_clouds, register_keyframes, segment
from objreg_ros.data.closures import Reason
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import Detections
from objreg_ros.geometry import back_project, inverse, pose_error, transform
from objreg_ros.registrar.params import RegistrarParams

CAMERA = Camera(rooms.CAMERA.fx, rooms.CAMERA.fy, rooms.CAMERA.cx, rooms.CAMERA.cy)
SIZED = replace(CAMERA, width=rooms.CAMERA.width, height=rooms.CAMERA.height)


class Shot(NamedTuple):
    """A picture of the room and what is known of it."""

    rgb: np.ndarray
    depth: np.ndarray
    T_world_camera: np.ndarray
    masks: list[tuple[np.ndarray, str, float]]

    @property
    def boxes(self) -> list[tuple[list[float], str, float]]:
        return [(around(mask), label, score) for mask, label, score in self.masks]

    @property
    def xyz(self) -> np.ndarray:
        xyz = back_project(self.depth, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy).astype(np.float32)
        return np.where((self.depth > 0)[..., None], xyz, np.float32("nan"))


def around(mask: np.ndarray) -> list[float]:
    v, u = np.nonzero(mask)
    return [u.min(), v.min(), u.max() + 1, v.max() + 1]


def shot(angle: float) -> Shot:
    T = rooms.seen_from(angle)
    depth, owner, _ = rooms.cast(T)
    noise = np.random.default_rng(round(angle) + 90).normal(0.0, 0.001, depth.shape) * depth**2
    points = back_project(depth, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    rgb = np.repeat(rooms.shade(transform(T, points))[..., None], 3, axis=2)
    names = [label for label, _, _ in rooms.ROOM]
    things = [k for k, name in enumerate(names) if name not in rooms.BACKGROUND and (owner == k).sum() > 80]
    return Shot(rgb, (depth + noise).astype(np.float32), T, [(owner == k, names[k], 0.9) for k in things])


ONE, TWO = shot(0.0), shot(15.0)
T_1_2 = inverse(ONE.T_world_camera) @ TWO.T_world_camera
PICTURES = ONE.rgb, ONE.depth, TWO.rgb, TWO.depth
MASKS = ONE.masks, TWO.masks


def assert_right(found: Registration, T: np.ndarray = T_1_2) -> None:
    assert found.accepted and found.reason is None, (found.reason, found.detail)
    assert found.T_1_2 is not None and found.covariance is not None
    degrees, cm = pose_error(found.T_1_2, T)
    assert degrees < 1.0 and cm < 2.5
    assert found.covariance.shape == (6, 6) and np.linalg.eigvalsh(found.covariance).min() > 0


def test_two_pictures_with_masks_give_the_pose_of_camera_2_in_camera_1() -> None:
    assert_right(register(*PICTURES, CAMERA, detections=MASKS))


def test_boxes_do_as_well_and_so_do_detections() -> None:
    boxes = register(*PICTURES, CAMERA, detections=(ONE.boxes, TWO.boxes))
    found = register(*PICTURES, CAMERA, detections=(detections_of(ONE), detections_of(TWO)))
    assert_right(boxes)
    assert found.T_1_2 is not None and boxes.T_1_2 is not None and np.array_equal(found.T_1_2, boxes.T_1_2)


def detections_of(of: Shot) -> Detections:
    return Detections(
        xyxy=np.array([box for box, _, _ in of.boxes], np.float32),
        score=np.array([score for _, _, score in of.boxes], np.float32),
        label=tuple(label for _, label, _ in of.boxes),
        image_hw=of.depth.shape,
        stamp_ns=0,
    )


def test_depth_in_millimetres_and_without_measurements_is_the_same_depth() -> None:
    def millimetres(of: Shot) -> np.ndarray:
        depth = np.rint(1000 * of.depth).astype(np.uint16)
        depth[:5] = 65535
        return depth

    def metres(of: Shot) -> np.ndarray:
        depth = np.rint(1000 * of.depth) / 1000
        depth[:3], depth[3:5] = np.nan, np.inf
        return depth

    a, b = (
        register(ONE.rgb, of(ONE), TWO.rgb, of(TWO), CAMERA, detections=MASKS).T_1_2 for of in (millimetres, metres)
    )
    assert a is not None and b is not None
    np.testing.assert_allclose(a, b, atol=1e-6)


def test_a_detector_of_ones_own_is_asked_for_each_picture() -> None:
    asked: list[np.ndarray] = []

    def detect(rgb: np.ndarray) -> list[tuple[np.ndarray, str, float]]:
        asked.append(rgb)
        return MASKS[len(asked) - 1]

    assert_right(register(*PICTURES, CAMERA, detector=detect))
    assert asked[0] is ONE.rgb and asked[1] is TWO.rgb


def test_without_objects_the_answer_is_no_with_a_reason_and_no_pose() -> None:
    refused = register(*PICTURES, CAMERA, detector=lambda rgb: [])
    assert not refused.accepted and isinstance(refused.reason, Reason) and refused.detail
    assert refused.T_1_2 is None and refused.covariance is None


def test_the_models_own_labels_are_found_where_nothing_is_said_of_objects() -> None:
    frame = segment(ONE.rgb, ONE.depth, CAMERA)
    assert isinstance(frame, Frame)


def test_a_gate_of_ones_own_refuses_and_its_reason_and_our_evidence_are_reported() -> None:
    refused = register(
        *PICTURES, CAMERA, detections=MASKS, gate=lambda candidates, prior=None: (Reason.MOVED, "all of it")
    )
    assert (refused.reason, refused.detail, refused.T_1_2) == (Reason.MOVED, "all of it", None)
    assert refused.evidence["score"] > 0


def test_the_founding_method_is_one_by_its_name() -> None:
    found = register(*PICTURES, CAMERA, detections=MASKS, method="paper")
    named = register(*PICTURES, CAMERA, detections=MASKS, params=RegistrarParams(method="paper"))
    assert (found.reason, found.detail) == (named.reason, named.detail)
    with pytest.raises(ValueError, match="method: expected one of objreg, paper, got 'icp'"):
        register(*PICTURES, CAMERA, detections=MASKS, method="icp")


def test_two_organised_clouds_need_no_camera() -> None:
    assert_right(register_clouds(ONE.xyz, ONE.rgb, TWO.xyz, TWO.rgb, detections=MASKS))


def test_two_lists_of_points_are_projected_with_the_camera() -> None:
    flat = [of.reshape(-1, 3) for of in (ONE.xyz, ONE.rgb, TWO.xyz, TWO.rgb)]
    assert_right(register_clouds(*flat, SIZED, detections=MASKS))


def frames(angles: tuple[float, ...], odometry: bool = True) -> list[Frame]:
    T_odom_world = rooms.seen_from(-60.0)  # anywhere: nothing is taken from it but motions
    seen = []
    for k, angle in enumerate(angles):
        of = shot(angle)
        T = T_odom_world @ of.T_world_camera if odometry else None
        seen.append(segment(of.rgb, of.depth, CAMERA, detections=of.masks, T_odom_camera=T, stamp_ns=k))
    return seen


@pytest.mark.parametrize(("first", "second"), [((0.0, 3.0, 6.0), (15.0, 18.0)), ((6.0, 3.0, 0.0), (18.0, 15.0))])
def test_lists_of_frames_give_the_pose_between_their_first_cameras(
    first: tuple[float, ...], second: tuple[float, ...]
) -> None:
    T = inverse(rooms.seen_from(first[0])) @ rooms.seen_from(second[0])
    assert_right(register_keyframes(frames(first), frames(second)), T)


def test_several_frames_need_odometry_and_no_list_is_empty() -> None:
    with pytest.raises(ValueError, match=r"frames_2: expected T_odom_camera of every frame .* got 2 of 2 without"):
        register_keyframes(frames((0.0,)), frames((15.0, 18.0), odometry=False))
    with pytest.raises(ValueError, match="frames_1: expected at least one frame, got none"):
        register_keyframes([], frames((15.0,)))


def pictures(**changed: Any) -> Callable[[], Registration]:
    given = {"rgb_1": ONE.rgb, "depth_1": ONE.depth, "rgb_2": TWO.rgb, "depth_2": TWO.depth, "camera": CAMERA}
    return lambda: register(**{"detections": MASKS, **given, **changed})


def clouds(xyz: np.ndarray, camera: Camera | None = None) -> Callable[[], Registration]:
    return lambda: register_clouds(xyz, None, TWO.xyz, None, camera, detections=([], []))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (pictures(depth_2=ONE.depth.astype(np.int32)), r"picture 2: depth: expected float .* got int32 of shape \(120"),
        (pictures(depth_1=ONE.depth[..., None]), r"picture 1: depth: expected .* got float32 of shape \(120, 160, 1\)"),
        (pictures(depth_1=-ONE.depth), "picture 1: DepthImage: expected depth of 0 to"),
        (pictures(depth_2=1000 * ONE.depth), r"picture 2: depth: expected metres.*millimetres\? .*depth \* 0\.001"),
        (pictures(rgb_2=TWO.rgb[::2]), r"picture 2: rgb: expected uint8 of shape \(120, 160, 3\), got uint8 of"),
        (pictures(rgb_1=ONE.rgb / 255.0), r"picture 1: rgb: expected uint8 .* got float64"),
        (pictures(camera=replace(SIZED, width=640)), "picture 1: camera: expected the picture's size 160 x 120"),
        (pictures(camera=replace(CAMERA, fx=-1.0)), "picture 1: Intrinsics: expected focal lengths"),
        (pictures(rgb_1=None, detections=None), "picture 1: rgb: expected uint8 .* to detect objects in, got None"),
        (pictures(detections=(ONE.masks,)), "detections: expected those of 1 and those of 2, got 1"),
        (pictures(detections=([([1, 2, 3], "cup", 0.5)], [])), r"picture 1: detection 0, 'cup': expected a box \(4,\)"),
        (pictures(detections=([], [("cup", 0.5)])), r"picture 2: detection 0: expected \(box or mask, label, score\)"),
        (pictures(detections=([([1, 2, 30, 40], "cup", 5)], [])), r"picture 1: Detections: expected scores in 0\.\.1"),
        (lambda: register_clouds(ONE.xyz[0, 0], None, TWO.xyz, None), r"cloud 1: xyz: expected float metres of shape"),
        (
            lambda: register_clouds(ONE.xyz.reshape(-1, 3), None, TWO.xyz, None, CAMERA, detections=MASKS),
            r"cloud 1: camera: expected a width and height for points \(N, 3\), got 0 x 0",
        ),
        (clouds(ONE.xyz * 1000), r"cloud 1: xyz: expected metres.*millimetres\? .*xyz \* 0\.001"),
        (clouds(ONE.xyz.reshape(-1, 3)), r"cloud 1: camera: expected one with a width and height .*, got None"),
        (clouds(-ONE.xyz), r"cloud 1: xyz: .* with negative z; give points in metres in the optical frame"),
        (clouds(ONE.xyz[:2, :2]), r"cloud 1: xyz: expected at least 30 measured points .*; give points in metres"),
        (clouds(ONE.xyz[..., [2, 0, 1]]), r"cloud 1: xyz: expected pixels that fit a pinhole camera .*; give points"),
        (clouds(ONE.xyz[..., [2, 0, 1]], CAMERA), r"cloud 1: xyz: expected .*; give points in metres"),
        (clouds(ONE.xyz.reshape(-1, 3) + np.float32([9, 0, 0]), SIZED), r"cloud 1: xyz: expected points within the"),
    ],
)
def test_bad_input_is_refused_with_what_was_expected_and_what_came(
    call: Callable[[], Registration], message: str
) -> None:
    with pytest.raises(ValueError, match=message) as refused:
        call()
    assert not re.search(r"/tf|camera_info|topic|publish|frame_id|\bROS\b", str(refused.value))


@pytest.mark.parametrize("metres", [0.4, 5.0, 60.0])
def test_depth_that_a_camera_sees_is_metres(metres: float) -> None:
    depth = np.full(ONE.depth.shape, metres, np.float32)
    depth[0] = 1e4  # as some drivers mark what is too far
    assert segment(ONE.rgb, depth, CAMERA, detections=[]).objects == ()


def test_an_empty_mask_is_no_object() -> None:
    nothing = np.zeros(ONE.depth.shape, bool)
    assert segment(ONE.rgb, ONE.depth, CAMERA, detections=[(nothing, "cup", 0.5)]).objects == ()


def test_the_same_pictures_give_the_same_answer() -> None:
    a, b = (register(*PICTURES, CAMERA, detections=MASKS) for _ in range(2))
    assert a.T_1_2 is not None and b.T_1_2 is not None and np.array_equal(a.T_1_2, b.T_1_2)
    assert a.evidence == b.evidence


def test_to_import_the_package_loads_nothing_and_its_help_begins_with_the_example() -> None:
    code = "import sys, objreg_ros; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    assert "from objreg_ros import Camera, register" in (objreg_ros.__doc__ or "").strip().splitlines()[0]


def test_the_public_names_are_there_and_no_other() -> None:
    assert all(getattr(objreg_ros, name).__doc__ for name in objreg_ros.__all__)
    assert set(objreg_ros.__all__) <= set(dir(objreg_ros))
    with pytest.raises(AttributeError, match="no attribute 'regsiter'"):
        objreg_ros.regsiter  # noqa: B018


def test_the_package_says_that_it_is_typed(repository: Path) -> None:
    assert (repository / "objreg_ros" / "py.typed").is_file()
    assert "py.typed" in (repository / "setup.py").read_text(encoding="utf-8")


LENS = replace(CAMERA, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))


def through_lens(seen: Shot) -> Shot:
    """The picture that a camera with `LENS` would have taken of what is in the picture."""
    of = LENS.lens(*seen.depth.shape)
    assert of is not None
    v, u = np.mgrid[: seen.depth.shape[0], : seen.depth.shape[1]]
    straight, known = of.rectify_uv(np.column_stack([u.ravel(), v.ravel()]).astype(float))
    assert known.all()
    column, row = straight.astype(np.float32).T.reshape(2, *seen.depth.shape)
    bend = lambda picture: cv2.remap(picture, column, row, cv2.INTER_NEAREST)  # noqa: E731
    masks = [(bend(mask.astype(np.uint8)) > 0, label, score) for mask, label, score in seen.masks]
    return seen._replace(rgb=bend(seen.rgb), depth=bend(seen.depth), masks=masks)


@pytest.mark.parametrize("what", ["masks", "boxes"])
def test_pictures_of_a_lens_are_rectified_with_their_masks_and_boxes(what: str) -> None:
    one, two = through_lens(ONE), through_lens(TWO)
    pictures, found = (one.rgb, one.depth, two.rgb, two.depth), (getattr(one, what), getattr(two, what))
    assert_right(register(*pictures, LENS, detections=found))


def test_a_lens_that_cannot_be_is_refused() -> None:
    with pytest.raises(
        ValueError, match="picture 1: lens: expected 4, 5, 8, 12 or 14 coefficients of plumb_bob, got 2"
    ):
        register(*PICTURES, replace(CAMERA, distortion=(0.1, 0.2)), detections=MASKS)
    with pytest.raises(ValueError, match=r"expected a distortion model of .*, got 'round'"):
        register(*PICTURES, replace(LENS, model="round"), detections=MASKS)


def test_a_lens_of_zeros_is_none() -> None:
    assert replace(CAMERA, distortion=(0.0,) * 5, model="round").lens(240, 320) is None
