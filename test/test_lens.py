# SPDX-License-Identifier: Apache-2.0
"""Lenses with known answers: what OpenCV projects through a lens comes back to where a pinhole camera sees it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.lens import Lens

CAMERA = Intrinsics(fx=260.0, fy=250.0, cx=161.0, cy=118.0, width=320, height=240)
WIDER = replace(CAMERA, fx=200.0, fy=210.0, cx=158.0)
COEFFICIENTS = {
    "plumb_bob": (-0.25, 0.08, 0.001, -0.002, 0.01),
    "plumb_bob, four": (0.2, -0.3, 0.001, 0.002),
    "plumb_bob, eight": (0.4, -2.5, 0.0005, -0.0003, 1.4, 0.3, -2.3, 1.3),
    "plumb_bob, fourteen": (0.2, -0.3, 0.001, 0.002, 0.1, 0.1, -0.2, 0.05, 0.002, 0.0, -0.001, 0.0, 0.01, -0.005),
    "rational_polynomial": (0.4, -2.5, 0.0005, -0.0003, 1.4, 0.3, -2.3, 1.3),
    "equidistant": (-0.03, 0.01, -0.005, 0.001),
}


def lens(name: str, camera: Intrinsics = CAMERA) -> Lens:
    return Lens(name.partition(",")[0], COEFFICIENTS[name], CAMERA, camera)


def matrix(camera: Intrinsics) -> np.ndarray:
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])


def projected(of: Lens, points: np.ndarray) -> np.ndarray:
    """Raw pixels (N, 2) of points (N, 3), by OpenCV's own projection."""
    zero, K, D = np.zeros(3), matrix(of.raw), np.array(of.D)
    if of.model == "equidistant":
        return cv2.fisheye.projectPoints(points.reshape(-1, 1, 3), zero, zero, K, D)[0].reshape(-1, 2)
    return cv2.projectPoints(points.reshape(-1, 1, 3), zero, zero, K, D)[0].reshape(-1, 2)


def pinhole(camera: Intrinsics, points: np.ndarray) -> np.ndarray:
    return points[:, :2] / points[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)


def grid(z: float = 2.0) -> np.ndarray:
    """Points (N, 3) on a wall."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 11) * z, np.linspace(-0.38, 0.38, 9) * z)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


@pytest.mark.parametrize("camera", [CAMERA, WIDER], ids=["K", "P"])
@pytest.mark.parametrize("name", COEFFICIENTS)
def test_pixels_of_a_grid_come_back_to_their_pinhole_projection(name: str, camera: Intrinsics) -> None:
    of = lens(name, camera)
    found, known = of.rectify_uv(projected(of, grid()))
    assert known.all() and np.abs(found - pinhole(camera, grid())).max() < 1e-3


@pytest.mark.parametrize("camera", [CAMERA, WIDER], ids=["K", "P"])
@pytest.mark.parametrize("name", COEFFICIENTS)
def test_pictures_of_dots_come_back_to_their_pinhole_projection(name: str, camera: Intrinsics) -> None:
    of, points = lens(name, camera), grid()
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    raw = projected(of, points)
    blobs = np.exp(-((u - raw[:, 0, None, None]) ** 2 + (v - raw[:, 1, None, None]) ** 2) / 8).sum(axis=0)
    rgb = np.dstack([np.rint(255 * blobs.clip(0, 1)).astype(np.uint8)] * 3)
    grey = of.rectify_colour(rgb)[..., 0].astype(float)
    for where in pinhole(camera, points):
        if (where < 5).any() or (where > (CAMERA.width - 6, CAMERA.height - 6)).any():
            continue
        column, row = np.rint(where).astype(int)
        patch = np.s_[row - 4 : row + 5, column - 4 : column + 5]
        weight = grey[patch] / grey[patch].sum()
        assert np.hypot((weight * u[patch]).sum() - where[0], (weight * v[patch]).sum() - where[1]) < 0.35


@pytest.mark.parametrize("name", COEFFICIENTS)
def test_depth_keeps_its_values_and_has_none_where_nothing_was_seen(name: str) -> None:
    of = lens(name, WIDER)
    depth = np.where(np.arange(CAMERA.width) % 2 == 0, np.float32(1), np.float32(3)) * np.ones((240, 1), np.float32)
    found = of.rectify_depth(depth)
    assert found.dtype == np.float32 and set(np.unique(found)) == {0, 1, 3}
    assert np.array_equal(found > 0, of.shown) and 0.3 < of.shown.mean() < 1


def test_a_slanted_plane_stays_that_plane() -> None:
    """Its depth, seen through the lens, is after rectification the depth that a pinhole camera sees."""
    of = lens("plumb_bob")
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width].astype(float)
    plane = lambda u, v: 1 / (0.5 + 0.3 * (u - CAMERA.cx) / CAMERA.fx - 0.2 * (v - CAMERA.cy) / CAMERA.fy)  # noqa: E731
    straight, known = of.rectify_uv(np.column_stack([u.ravel(), v.ravel()]))
    assert known.all()
    raw = plane(*straight.T).reshape(u.shape).astype(np.float32)
    found, true = of.rectify_depth(raw), plane(u, v)
    half_a_pixel = 0.8 * (0.3 / CAMERA.fx + 0.2 / CAMERA.fy)  # of inverse depth: a raw pixel is wider in the corners
    assert np.abs(1 / raw - 1 / true).max() > 10 * half_a_pixel
    assert np.abs(1 / found[of.shown] - 1 / true[of.shown]).max() < half_a_pixel


@pytest.mark.parametrize("name", COEFFICIENTS)
def test_a_box_becomes_the_box_around_its_rectified_outline(name: str) -> None:
    of = lens(name)
    box = np.array([[40.0, 30.0, 200.0, 190.0]])
    (found,) = of.rectify_xyxy(box)
    u, v = of._maps
    shows = (u > 39.5) & (u < 199.5) & (v > 29.5) & (v < 189.5)
    rows, columns = np.flatnonzero(shows.any(axis=1)), np.flatnonzero(shows.any(axis=0))
    around = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    assert np.abs(found - around).max() < 1.0 and np.abs(found - box[0]).max() > 0.5


def test_boxes_of_a_picture_of_another_size_are_rectified_at_that_size() -> None:
    of = lens("plumb_bob")
    box = np.array([[40, 30, 200, 190]], np.float32)
    one, two = (
        of.rectify_detections(
            Detections(
                xyxy=scale * box, score=np.ones(1, np.float32), label=("cup",), image_hw=(240 * scale, 320 * scale),
                stamp_ns=5,
            )
        )
        for scale in (1, 2)
    )  # fmt: skip
    assert np.abs(two.xyxy - 2 * one.xyxy).max() < 1e-3 and two.image_hw == (480, 640) and two.label == ("cup",)


@pytest.mark.parametrize("scale", [1, 2])
def test_masks_are_rectified_as_depth_is_whatever_their_size(scale: int) -> None:
    of = lens("plumb_bob")
    numbers = np.zeros((240 * scale, 320 * scale), np.uint16)
    numbers[60 * scale : 200 * scale, 30 * scale : 130 * scale] = 1
    detections = Detections(xyxy=np.array([[30, 60, 130, 200]], np.float32) * scale, score=np.ones(1, np.float32),
                            label=("cup",), image_hw=numbers.shape, stamp_ns=5, instances=numbers)  # fmt: skip
    found = of.rectify_detections(detections).instances
    np.testing.assert_array_equal(found, of.rectify_depth(np.ascontiguousarray(numbers[::scale, ::scale])))
    assert not np.array_equal(found, numbers[::scale, ::scale])


def test_no_boxes_stay_none_and_a_box_beside_the_picture_stays_empty() -> None:
    of = lens("plumb_bob")
    assert of.rectify_xyxy(np.zeros((0, 4))).shape == (0, 4)
    (found,) = of.rectify_xyxy(np.array([[-50.0, 20.0, -10.0, 60.0]]))
    assert found[2] - found[0] < 1e-6


def test_a_mask_goes_where_its_depth_goes() -> None:
    of = lens("equidistant")
    mask = np.zeros((240, 320), np.bool_)
    mask[40:90, 20:70] = True
    found = of.rectify_mask(mask)
    assert found.dtype == np.bool_ and np.array_equal(found, of.rectify_depth(mask.astype(np.float32)) > 0)


def test_a_picture_is_rectified_as_far_as_it_is_raw() -> None:
    of = lens("plumb_bob", WIDER)
    rng = np.random.default_rng(1)
    image = DepthImage(
        depth=rng.uniform(1, 2, (240, 320)).astype(np.float32), rgb=rng.integers(0, 255, (240, 320, 3), np.uint8),
        intrinsics=CAMERA, stamp_ns=7, frame_id="eye",
    )  # fmt: skip
    both, colour = of.rectify(image), of.rectify(image, depth=False)
    assert both.intrinsics is WIDER and (both.stamp_ns, both.frame_id) == (7, "eye")
    assert both.shown is not None and np.array_equal(both.shown, of.shown)
    assert np.array_equal(colour.depth, image.depth) and colour.shown is None
    assert np.array_equal(colour.rgb, both.rgb) and not np.array_equal(both.rgb, image.rgb)


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a picture of 320 x 240 px, got 64 x 48"):
        lens("plumb_bob").rectify_depth(np.ones((48, 64), np.float32))


def test_a_lens_says_how_far_it_moves_pixels() -> None:
    kinect = Intrinsics(fx=517.306408, fy=516.469215, cx=318.64304, cy=255.313989, width=640, height=480)
    of = Lens("plumb_bob", (0.262383, -0.953104, -0.005358, 0.002628, 1.163314), kinect, kinect)
    assert str(of) == "plumb_bob, moves a pixel by 4.8 px (median), 36.8 at most"
    assert str(replace(of, camera=replace(kinect, fx=400.0))) == str(of)  # a zoom is no lens


def test_a_turned_camera_sees_rays_where_the_turn_puts_them() -> None:
    R, _ = cv2.Rodrigues(np.array([0.02, -0.05, 0.01]))
    of = replace(lens("plumb_bob"), R=tuple(R.ravel()))
    found, known = of.rectify_uv(projected(of, grid()))
    assert known.all() and np.abs(found - pinhole(CAMERA, grid() @ R.T)).max() < 1e-3
    u, v = of._maps
    assert np.hypot(*(np.array([u[120, 160], v[120, 160]]) - of._seen_at(np.array([[-1 / 260, 2 / 250]]))[0])) < 1e-3


@pytest.mark.parametrize("count", [8, 12, 14])
def test_a_plumb_bob_of_more_than_five_numbers_is_a_rational_polynomial(count: int) -> None:
    D = COEFFICIENTS["plumb_bob, fourteen"][:count]
    one, other = Lens("plumb_bob", D, CAMERA, CAMERA), Lens("rational_polynomial", D, CAMERA, CAMERA)
    assert np.array_equal(one._maps, other._maps)
    assert np.abs(one._maps[0] - lens("plumb_bob")._maps[0]).max() > 1.0


@pytest.mark.parametrize("count", [6, 8, 11, 12, 14])
def test_zeros_behind_the_five_of_a_plumb_bob_change_nothing(count: int) -> None:
    five = COEFFICIENTS["plumb_bob"]
    filled = Lens("plumb_bob", (*five, *(0.0,) * (count - 5)), CAMERA, CAMERA)
    assert np.array_equal(filled._maps, lens("plumb_bob")._maps)
    box = np.array([[40.0, 30.0, 200.0, 190.0]])
    assert np.array_equal(filled.rectify_xyxy(box), lens("plumb_bob").rectify_xyxy(box))


def test_zeros_behind_the_numbers_of_a_fisheye_change_nothing() -> None:
    four = lens("equidistant")
    filled = Lens("equidistant", (*four.D, 0.0), CAMERA, CAMERA)
    assert np.array_equal(filled._maps, four._maps)


@pytest.mark.parametrize(
    ("model", "D", "said"),
    [
        ("plumb_bob", (0.1,) * 6, "expected 4, 5, 8, 12 or 14 coefficients of plumb_bob, got 6"),
        ("plumb_bob", (0.1, 0.2), "expected 4, 5, 8, 12 or 14 coefficients of plumb_bob, got 2"),
        ("rational_polynomial", (0.1,) * 5, "expected 8, 12 or 14 coefficients of rational_polynomial, got 5"),
        ("equidistant", (0.1,) * 5, "expected 4 coefficients of equidistant, got 5"),
        ("omnidirectional", (0.1,) * 5, "expected a distortion model of plumb_bob, .*, got 'omnidirectional'"),
        ("plumb_bob", (float("nan"), 0, 0, 0, 0), "expected finite coefficients of plumb_bob, got .nan"),
        ("plumb_bob", (float("inf"), 0, 0, 0, 0), "expected finite coefficients"),
        ("plumb_bob", (-40.0, 0, 0, 0, 0), "shows at least 25 % of its pixels, got [0-9]+ %"),
        ("plumb_bob", (1e300, 1e300, -1e300, 0, 1e300), "shows at least 25 % of its pixels, got 0 %"),
        ("plumb_bob", (1e30, 0, 0, 0, 0), "folds over itself or leaves its frame"),
        ("rational_polynomial", (0, 0, 0, 0, 0, -30.0, 0, 0), "shows at least 25 %"),
        ("equidistant", (-1e9, 1e9, 0, 0), "shows at least 25 %"),
    ],
)
def test_a_lens_that_cannot_be_is_refused_in_one_line(model: str, D: tuple[float, ...], said: str) -> None:
    with pytest.raises(ValueError, match=said) as refusal:
        Lens(model, D, CAMERA, CAMERA)
    assert "\n" not in str(refusal.value)


def test_what_lies_behind_a_fold_in_the_corners_is_not_shown_and_has_no_place() -> None:
    wide = replace(CAMERA, fx=110.0, fy=110.0)
    folding = Lens("plumb_bob", (-0.2, 0, 0, 0), wide, wide)  # it turns back where 1 = 0.6 r²
    v, u = np.mgrid[:240, :320]
    r = np.hypot((u - wide.cx) / wide.fx, (v - wide.cy) / wide.fy)
    assert not folding.shown[r > 1.31].any() and folding.shown[r < 1.27].all()
    found, known = folding.rectify_uv(np.array([[wide.cx, wide.cy], [0.0, 0.0]]))
    assert known.tolist() == [True, False] and found[1].tolist() == [0, 0]
    assert np.isfinite(folding.rectify_xyxy(np.array([[0.0, 0, 320, 240], [0, 0, 3, 3]]))).all()


def test_cameras_of_two_sizes_or_of_too_large_a_one_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected two cameras of one size .*, got \(320, 240\) and \(160, 240\)"):
        Lens("plumb_bob", COEFFICIENTS["plumb_bob"], CAMERA, replace(CAMERA, width=160))
    long = replace(CAMERA, width=40000, height=2)
    with pytest.raises(ValueError, match="at most 32766 px"):
        Lens("plumb_bob", COEFFICIENTS["plumb_bob"], long, long)


def test_a_rotation_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a rotation R"):
        replace(lens("plumb_bob"), R=(2.0, 0, 0, 0, 1, 0, 0, 0, 1))


def test_folds_of_a_large_picture_are_found_on_a_part_of_its_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = replace(CAMERA, fx=110.0, fy=110.0)
    whole = Lens("plumb_bob", (-0.2, 0, 0, 0), wide, wide)
    monkeypatch.setattr("objreg_ros.lens.FOLD_PIXELS", wide.width * wide.height / 9)
    thinned = Lens("plumb_bob", (-0.2, 0, 0, 0), wide, wide)
    assert (whole.shown != thinned.shown).mean() < 0.02 and 0.5 < whole.shown.mean() < 0.95
