# SPDX-License-Identifier: Apache-2.0
"""Whatever comes in: the segmenter does not crash, and never returns a point outside its box."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from objreg_ros.data.frames import UNNAMED, ObjectCloud
from objreg_ros.data.images import DepthImage, Detections, Intrinsics, PointCloud
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.sensor.organise import organise

SIZES = st.tuples(st.integers(1, 60), st.integers(1, 80))
NUMBERS = st.floats(-200, 200, width=32)
METHODS = {name: Segmenter(SegmenterParams(preset=name, min_points=1)) for name in ("default", "paper")}


def relief(height: int, width: int, seed: int, holes: float) -> np.ndarray:
    """A slanted floor with blocks on it, with noise, holes and nonsense."""
    rng = np.random.default_rng(seed)
    depth = np.linspace(2.5, 0.6, height)[:, None] * np.ones(width)
    for _ in range(rng.integers(0, 6)):
        v, u = rng.integers(0, height), rng.integers(0, width)
        depth[v : v + rng.integers(1, 20), u : u + rng.integers(1, 20)] = rng.uniform(0.1, 5)
    depth += rng.normal(0, 0.003, depth.shape)
    depth[rng.random(depth.shape) < holes] = 0
    nonsense = rng.random(depth.shape) < 0.02
    depth[nonsense] = rng.choice([65.535, 65535.0, 1e-9], nonsense.sum())
    depth[depth < 0] = 0
    return depth.astype(np.float32)


def camera_of(height: int, width: int) -> Intrinsics:
    return Intrinsics(fx=0.8 * width, fy=0.8 * width, cx=width / 2, cy=height / 2, width=width, height=height)


def boxes_of(boxes: list[tuple[float, ...]], image_hw: tuple[int, int]) -> Detections:
    n = len(boxes)
    xyxy = np.array(boxes, np.float32).reshape(-1, 4)
    return Detections(
        xyxy=xyxy, score=np.ones(n, np.float32), label=tuple(map(str, range(n))), image_hw=image_hw, stamp_ns=0
    )


def require_inside(thing: ObjectCloud, camera: Intrinsics, box: tuple[float, ...], image_hw: tuple[int, int]) -> None:
    """Every pixel of the object lies wholly within its box, that is one of a picture of ``image_hw``."""
    uv = np.rint(thing.xyz[:, :2] / thing.xyz[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy))
    low, high = np.array(box).reshape(2, 2) * (camera.width / image_hw[1], camera.height / image_hw[0])
    assert (uv >= low - 1e-2).all()
    assert (uv + 1 <= high + 1e-2).all()


LARGE = st.sampled_from([(240, 320), (480, 640), (480, 848), (720, 1280), (360, 37)])
SHARES = st.tuples(*[st.floats(-0.25, 1.25, width=32)] * 4)


@settings(max_examples=25, deadline=None)
@given(size=LARGE, seed=st.integers(0, 10_000), boxes=st.lists(SHARES, max_size=4), image_hw=LARGE)
def test_cameras_of_every_size_give_points_of_their_boxes_alone(
    size: tuple[int, int], seed: int, boxes: list[tuple[float, ...]], image_hw: tuple[int, int]
) -> None:
    h, w = image_hw
    pixels = [(a * w, b * h, c * w, d * h) for a, b, c, d in boxes]
    image = DepthImage(depth=relief(*size, seed, 0.1), rgb=None, intrinsics=camera_of(*size), stamp_ns=0)
    found = METHODS["default"].segment(boxes_of(pixels, image_hw), image).objects
    for thing in (one for one in found if one.label != UNNAMED):
        require_inside(thing, image.intrinsics, pixels[int(thing.label)], image_hw)


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=60, deadline=None)
@given(
    size=SIZES,
    seed=st.integers(0, 10_000),
    holes=st.sampled_from([0.0, 0.1, 0.6, 1.0]),
    boxes=st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS), max_size=4),
    image_hw=SIZES,
    coloured=st.booleans(),
)
def test_any_boxes_on_any_depth_give_points_of_their_boxes_alone(
    method: str,
    size: tuple[int, int],
    seed: int,
    holes: float,
    boxes: list[tuple[float, ...]],
    image_hw: tuple[int, int],
    coloured: bool,
) -> None:
    camera = camera_of(*size)
    rgb = np.full((*size, 3), 7, np.uint8) if coloured else None
    image = DepthImage(depth=relief(*size, seed, holes), rgb=rgb, intrinsics=camera, stamp_ns=0)
    for thing in METHODS[method].segment(boxes_of(boxes, image_hw), image).objects:
        if thing.label != UNNAMED:
            require_inside(thing, camera, boxes[int(thing.label)], image_hw)
        assert (thing.xyz[:, 2] > 0).all()
        lengths = np.linalg.norm(thing.normals, axis=1)
        assert (np.isclose(lengths, 1, atol=1e-3) | (lengths == 0)).all()
        assert thing.density > 0


@settings(max_examples=60, deadline=None)
@given(size=SIZES, seed=st.integers(0, 10_000), known=st.booleans(), flat=st.booleans())
def test_any_cloud_becomes_a_depth_image_or_is_refused_with_a_reason(
    size: tuple[int, int], seed: int, known: bool, flat: bool
) -> None:
    rng = np.random.default_rng(seed)
    xyz = rng.normal(0, 1, (*size, 3)).astype(np.float32) + np.array([0, 0, rng.choice([0, 2, 3])], np.float32)
    xyz[rng.random(size) < 0.2] = rng.choice([np.nan, np.inf, 0, 65535])
    cloud = PointCloud(xyz=xyz.reshape(1, -1, 3) if flat else xyz, rgb=None, stamp_ns=0)
    try:
        image = organise(cloud, camera_of(*size) if known else None)
    except ValueError as refusal:
        assert "got" in str(refusal)
        return
    assert np.isfinite(image.depth).all()
    assert (image.depth >= 0).all()
    METHODS["default"].segment(boxes_of([(0, 0, size[1], size[0])], size), image)


@settings(max_examples=20, deadline=None)
@given(gravity=st.tuples(NUMBERS, NUMBERS, NUMBERS), seed=st.integers(0, 1000))
def test_any_direction_of_gravity_is_used_or_refused(gravity: tuple[float, float, float], seed: int) -> None:
    image = DepthImage(depth=relief(48, 64, seed, 0.1), rgb=None, intrinsics=camera_of(48, 64), stamp_ns=0)
    asked = boxes_of([(5, 5, 50, 40)], (48, 64))
    if np.linalg.norm(gravity) < 1e-6:
        with pytest.raises(ValueError, match="gravity"):
            METHODS["default"].segment(asked, image, gravity=np.array(gravity))
        return
    frame = METHODS["default"].segment(asked, image, gravity=np.array(gravity))
    assert frame.gravity is not None
    assert frame.gravity_confidence == 1.0
