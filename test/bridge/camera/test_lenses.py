# SPDX-License-Identifier: Apache-2.0
"""What a camera_info says of its lens, and which pictures are rectified by it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bridge import sample_messages as messages
from objreg_ros.bridge.camera import lenses
from objreg_ros.bridge.camera.lenses import Raw, raw_pictures
from objreg_ros.bridge.messages import from_msg
from objreg_ros.data.checked import Array
from objreg_ros.data.images import Detections, PointCloud

K = [500.0, 0, 319.5, 0, 500.0, 239.5, 0, 0, 1]
P = (450.0, 0, 310.0, 0, 0, 460.0, 240.0, 0, 0, 0, 1, 0)
D = [-0.2, 0.05, 0.001, -0.001, 0.0]
TURNED = [0.998750, 0.0, 0.049979, 0.0, 1.0, 0.0, -0.049979, 0.0, 0.998750]


def camera(
    D: object = D, model: str = "plumb_bob", P: tuple[float, ...] = (0.0,) * 12, R: object = (0.0,) * 9
) -> SimpleNamespace:
    info = messages.camera_info(K, 640, 480, P)
    info.d, info.distortion_model, info.r = D, model, R
    return info


def pictures() -> tuple[SimpleNamespace, SimpleNamespace, Array, Array]:
    rng = np.random.default_rng(3)
    millimetres = rng.integers(500, 3000, (480, 640)).astype(np.uint16)
    rgb = rng.integers(0, 255, (480, 640, 3)).astype(np.uint8)
    return messages.image(millimetres, "16UC1"), messages.image(rgb, "rgb8"), millimetres, rgb


def boxes() -> Detections:
    return Detections(
        xyxy=np.array([[20, 30, 200, 240]], np.float32), score=np.ones(1, np.float32), label=("cup",),
        image_hw=(480, 640), stamp_ns=0,
    )  # fmt: skip


@pytest.mark.parametrize("D", [[], [0.0] * 5, np.zeros(8), [0.0] * 3])
@pytest.mark.parametrize("model", ["plumb_bob", "", "nobody's"])
def test_without_distortion_every_bit_stays(D: object, model: str) -> None:
    depth, colour, millimetres, rgb = pictures()
    info, found = camera(D, model, P), boxes()
    image = lenses.depth_image(depth, info, colour)
    assert np.array_equal(image.depth, millimetres * np.float32(0.001)) and np.array_equal(image.rgb, rgb)
    assert image.intrinsics.fx == 450.0 and image.shown is None
    assert lenses.detections(found, info) is found
    assert lenses.describe(info) == "none stated: taken as rectified"


def test_a_camera_info_without_a_distortion_has_no_lens() -> None:
    info = messages.camera_info(K, 640, 480)
    del info.d
    assert not lenses.is_distorted(info) and lenses.lens_of(info) is None


def test_depth_colour_and_boxes_are_rectified_together_into_the_camera_of_P() -> None:
    depth, colour, _, rgb = pictures()
    info = camera(P=P)
    of = lenses.lens_of(info)
    assert of is not None and (of.raw.fx, of.camera.fx, of.camera.cx) == (500.0, 450.0, 310.0)
    image = lenses.depth_image(depth, info, colour)
    raw = from_msg.depth_image(depth, info, colour)
    assert np.array_equal(image.depth, of.rectify_depth(raw.depth)) and np.array_equal(
        image.rgb, of.rectify_colour(rgb)
    )
    assert (image.intrinsics.fx, image.intrinsics.fy, image.intrinsics.cx) == (450.0, 460.0, 310.0)
    assert np.array_equal(lenses.detections(boxes(), info).xyxy, of.rectify_xyxy(boxes().xyxy).astype(np.float32))


def test_the_camera_is_K_where_P_is_zeros_and_where_R_would_turn_raw_depth() -> None:
    for info in (camera(), camera(P=P, R=TURNED)):
        of = lenses.lens_of(info)
        assert of is not None and of.camera.fx == 500.0 and of.R == lenses.UPRIGHT
    turning = lenses.lens_of(camera(P=P, R=TURNED), Raw(depth=False))
    assert turning is not None and turning.camera.fx == 450.0 and list(turning.R) == TURNED


def test_binning_and_region_of_interest_move_the_lens_too() -> None:
    info = camera()
    info.binning_x = info.binning_y = 2
    info.roi.x_offset, info.roi.y_offset, info.roi.width, info.roi.height = 100, 40, 400, 300
    of, whole = lenses.lens_of(info), lenses.lens_of(camera())
    assert of is not None and whole is not None and (of.raw.width, of.raw.height) == (200, 150)
    (here, _), (there, _) = (of.rectify_uv(np.array([[10.0, 10]])), whole.rectify_uv(np.array([[120.0, 60]])))
    assert np.allclose(2 * here + (100, 40), there, atol=0.01)


def test_the_maps_of_a_lens_are_made_once() -> None:
    assert lenses.lens_of(camera()) is lenses.lens_of(camera())
    assert lenses.lens_of(camera()) is not lenses.lens_of(camera([-0.2, 0.05, 0, 0, 0]))


def test_the_fields_of_ros_1_are_read_too() -> None:
    info = camera(P=P)
    info.D, info.K, info.P, info.R = info.d, info.k, info.p, info.r
    del info.d, info.k, info.p, info.r
    assert lenses.lens_of(info) is lenses.lens_of(camera(P=P))


def test_fisheye_is_another_name_of_equidistant() -> None:
    of = lenses.lens_of(camera([0.1, 0.01, 0, 0], "fisheye"))
    assert of is not None and of.model == "equidistant"


@pytest.mark.parametrize(
    ("model", "D", "said"),
    [
        ("nobody's", D, 'expected a distortion model of plumb_bob, .*got "nobody\'s"'),
        ("", D, "expected a distortion model of plumb_bob, .*got ''"),
        ("plumb_bob", [0.1, 0.2], "expected 4, 5, 8, 12 or 14 coefficients of plumb_bob, got 2"),
        ("plumb_bob", [float("nan")] * 5, "expected finite coefficients"),
        ("plumb_bob", [-1e200] * 5, "folds over itself"),
        ("plumb_bob", np.ones(100_000), "expected at most 14 coefficients of distortion, got 100000"),
    ],
)
def test_a_lens_that_cannot_be_undone_is_refused_with_what_to_do(model: str, D: object, said: str) -> None:
    depth, _, _, _ = pictures()
    with pytest.raises(ValueError, match=f"camera_info: .*{said}.*; set segmenter.rectified to all") as refusal:
        lenses.depth_image(depth, camera(D, model))
    assert "\n" not in str(refusal.value)
    assert lenses.depth_image(depth, camera(D, model), raw=raw_pictures("all", None, None)).shown is None


def test_distortion_without_a_camera_matrix_is_refused() -> None:
    info = messages.camera_info([0.0] * 9, 640, 480, P)
    info.d, info.distortion_model, info.r = D, "plumb_bob", [0.0] * 9
    with pytest.raises(ValueError, match="expected a calibrated K with focal lengths above 0"):
        lenses.lens_of(info)


@pytest.mark.parametrize(
    ("depth", "image", "raw"),
    [
        ("/camera/depth_registered/image_raw", "/camera/rgb/image_raw", Raw(True, True)),
        ("/camera/depth_registered/image_rect", "/camera/rgb/image_raw", Raw(False, True)),
        ("/camera/depth_registered/image_raw", "/camera/rgb/image_rect_color", Raw(True, False)),
        ("/camera/depth_registered/hw_registered/image_rect_raw", "/camera/rgb/image_color_rect", Raw(False, False)),
        ("/direct/depth", "/correct/image", Raw(True, True)),
        ("/cam/image_rectified", "/cam/image_undistorted", Raw(False, False)),
        (None, None, Raw(True, True)),
    ],
)
def test_the_names_of_topics_state_which_pictures_are_raw(depth: str | None, image: str | None, raw: Raw) -> None:
    assert raw_pictures("auto", depth, image) == raw
    assert raw_pictures("all", depth, image) == Raw(False, False)
    assert raw_pictures("none", depth, image) == Raw(True, True)


def test_a_picture_that_is_rectified_already_is_left_as_it_is() -> None:
    depth, colour, millimetres, rgb = pictures()
    metres = millimetres * np.float32(0.001)
    nothing = lenses.depth_image(depth, camera(P=P), colour, raw=Raw(False, False))
    assert np.array_equal(nothing.depth, metres) and np.array_equal(nothing.rgb, rgb)
    half = lenses.depth_image(depth, camera(P=P), colour, raw=Raw(False, True))
    assert np.array_equal(half.depth, metres) and not np.array_equal(half.rgb, rgb) and half.intrinsics.fx == 450.0
    assert lenses.detections(found := boxes(), camera(), Raw(True, False)) is found


def test_boxes_go_with_points_that_are_projected_and_stay_with_those_that_are_a_picture() -> None:
    found = boxes()
    picture, loose = (PointCloud(xyz=np.ones((h, 40, 3), np.float32), rgb=None, stamp_ns=0) for h in (4, 1))
    assert lenses.detections(found, camera(), cloud=picture) is found
    assert not np.array_equal(lenses.detections(found, camera(), cloud=loose).xyxy, found.xyxy)
    assert lenses.detections(found, None, cloud=loose) is found


def test_what_is_assumed_is_said() -> None:
    whole = lenses.describe(camera())
    assert whole.startswith("plumb_bob, moves a pixel by ") and whole.endswith(" at most; rectified")
    assert lenses.describe(camera(), Raw(False, True)).endswith("; colour rectified, the other is so already")
    assert lenses.describe(camera(), Raw(False, False)).startswith(
        "plumb_bob stated, but the pictures are taken as rect"
    )
    assert lenses.describe(camera(), points=True) == "plumb_bob stated; points are taken as they come"
