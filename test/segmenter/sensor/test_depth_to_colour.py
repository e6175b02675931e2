# SPDX-License-Identifier: Apache-2.0
"""Depth that is turned against colour is brought upon it: a wall with boards before it, seen by two cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import rotation_from_vector
from objreg_ros.limits import MOST_DEPTH
from objreg_ros.segmenter.sensor.depth_to_colour import (
    FIRST_SIGMA,
    MEMORY,
    NOISE,
    DepthToColour,
    find_rotation,
    turned,
)

CAMERA = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480)
WALL = 2.5  # m
BOARDS = (  # left, top, width, height, depth in m
    (-0.7, -0.5, 0.35, 0.3, 1.5),
    (0.1, -0.45, 0.3, 0.5, 1.4),
    (-0.4, 0.05, 0.5, 0.25, 1.7),
    (0.45, 0.2, 0.2, 0.3, 1.3),
)
WIDE = np.full(3, 0.03)
LAG = np.array([0.012, -0.020, 0.025])
KINECT = 1.0  # noise


def rays() -> Array:
    """The rays (H, W, 3) of the pixels, 1 deep."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    x, y = (u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def seen(rotation: Array, shift: float = 0.0) -> tuple[Array, Array]:
    """Depth and shade (H, W) of a camera turned by ``rotation (3,)`` rad; the boards are ``shift`` m to the right."""
    R = rotation_from_vector(rotation)
    ray = rays() @ R.T
    reach, shade = WALL / ray[..., 2], np.full(ray.shape[:2], 60.0)
    for k, (x, y, width, height, z) in enumerate(BOARDS):
        at = z / ray[..., 2]
        px, py = at * ray[..., 0] - x - shift, at * ray[..., 1] - y
        hit = (px >= 0.0) & (px <= width) & (py >= 0.0) & (py <= height) & (at < reach)
        reach, shade = np.where(hit, at, reach), np.where(hit, 120.0 + 30.0 * k, shade)
    return reach.astype(np.float32), shade  # a ray is 1 deep in its own camera


def image(rotation: Array, shift: float = 0.0) -> DepthImage:
    """Colour of a camera, depth of another one that is turned against it."""
    depth, _ = seen(rotation, shift)
    _, shade = seen(np.zeros(3), shift)
    rgb = np.repeat(shade.astype(np.uint8)[..., None], 3, axis=2)
    return DepthImage(depth=depth, rgb=rgb, intrinsics=CAMERA, stamp_ns=0)


@pytest.mark.parametrize("rotation", [np.zeros(3), LAG, -LAG, np.array([0.0, 0.03, 0.0])])
def test_the_rotation_is_found_by_the_edges(rotation: Array) -> None:
    found = find_rotation(image(rotation), np.zeros(3), WIDE)
    assert found is not None
    assert found == pytest.approx(rotation, abs=0.002)


def test_depth_that_is_turned_back_is_what_the_colour_camera_sees() -> None:
    back, truth = turned(image(LAG), LAG).depth, seen(np.zeros(3))[0]
    known = back > 0.0
    assert known.mean() > 0.9
    assert np.median(np.abs(back - truth)[known]) < 0.002
    assert (np.abs(back - truth)[known] > 0.02).mean() < 0.02  # edges


def test_what_no_depth_pixel_saw_is_none() -> None:
    back = turned(image(LAG), np.array([0.0, 0.1, 0.0])).depth
    gone = round(0.1 * CAMERA.fx)
    assert not back[:, -gone + 4 :].any() or not back[:, : gone - 4].any()


def test_a_picture_without_depth_steps_gives_nothing_and_is_turned_as_those_before() -> None:
    stream = DepthToColour()
    for k in range(20):
        stream.register(image(LAG, 0.01 * k), KINECT)
    bare = image(LAG)
    plain = DepthImage(depth=np.full_like(bare.depth, 2.0), rgb=bare.rgb, intrinsics=CAMERA, stamp_ns=0)
    offset = stream.offset(plain)
    assert not offset.shown and offset.rotation == pytest.approx(LAG, abs=0.002)


def test_depth_without_colour_is_left_as_it_is() -> None:
    plain = image(LAG)
    without = DepthImage(depth=plain.depth, rgb=None, intrinsics=CAMERA, stamp_ns=0)
    assert DepthToColour().register(without, KINECT) is without


def test_a_stream_whose_frames_agree_takes_their_mean_and_one_that_turns_takes_each() -> None:
    still, turning = DepthToColour(), DepthToColour()
    rng = np.random.default_rng(0)
    for _ in range(60):
        still._remember(LAG + NOISE * rng.normal(size=3))
        turning._remember(0.03 * rng.normal(size=3))
    assert still.mean == pytest.approx(LAG, abs=0.002) and (still.spread < 3.0 * NOISE).all()
    assert (turning.spread > 0.015).all()


def test_one_frame_that_errs_hardly_moves_what_is_remembered() -> None:
    stream = DepthToColour()
    for _ in range(60):
        stream._remember(LAG)
    stream._remember(LAG + 0.06)
    assert stream.mean == pytest.approx(LAG, abs=0.001)


def test_another_camera_begins_anew() -> None:
    stream = DepthToColour()
    for k in range(20):
        stream.register(image(LAG, 0.01 * k), KINECT)
    other = replace(image(np.zeros(3)), frame_id="another")
    assert stream.offset(other).rotation == pytest.approx(np.zeros(3), abs=0.002) and stream.frames == 1


def test_depth_steps_without_edges_of_colour_give_nothing() -> None:
    painted = image(LAG)
    rng = np.random.default_rng(0)
    noise = np.kron(rng.integers(0, 256, (60, 80)), np.ones((8, 8))).astype(np.uint8)
    assert find_rotation(replace(painted, rgb=np.repeat(noise[..., None], 3, axis=2)), np.zeros(3), WIDE) is None


def test_a_lone_frame_is_turned_far_less_than_one_of_a_stream_that_insists() -> None:
    stream, seen_once = DepthToColour(), image(LAG)
    first = stream.offset(seen_once).rotation
    for _ in range(9):
        later = stream.offset(seen_once).rotation
    assert np.abs(later - LAG).max() < 0.003
    assert np.linalg.norm(first) <= np.linalg.norm(later) + 1e-3
    assert np.radians(0.25) > FIRST_SIGMA  # a frame with few things is led astray by degrees


def test_what_was_found_is_said_in_degrees() -> None:
    stream = DepthToColour()
    assert stream.text() == ""
    for _ in range(90):
        stream._remember(np.radians([0.5, -1.0, 0.0]))
    assert stream.text().startswith("0.50 -1.00 0.00 deg about x y z, 0.")


@pytest.mark.parametrize("focal", [1e-3, 1.0, 1e5])
@pytest.mark.parametrize("depth", [MOST_DEPTH, 1e-3])
def test_no_camera_and_no_depth_makes_depth_that_is_none(focal: float, depth: float) -> None:
    camera = Intrinsics(fx=focal, fy=focal, cx=20.0, cy=-3.0, width=64, height=48)
    board = np.where(np.indices((48, 64)).sum(axis=0) % 5 > 2, depth, 0.5 * depth).astype(np.float32)
    rgb = np.random.default_rng(0).integers(0, 256, (48, 64, 3)).astype(np.uint8)
    odd = DepthImage(depth=board, rgb=rgb, intrinsics=camera, stamp_ns=0)
    for rotation in (LAG, -LAG, np.full(3, 0.06)):
        back = turned(odd, rotation).depth
        assert (back >= 0.0).all() and back.max() <= MOST_DEPTH
    find_rotation(odd, np.zeros(3), WIDE)


def test_what_the_raw_picture_showed_is_kept() -> None:
    shown = np.ones((480, 640), np.bool_)
    shown[:, :20] = False
    assert np.array_equal(turned(replace(image(LAG), shown=shown), LAG).shown, shown)


def test_depth_of_a_stereo_camera_is_left_as_it_is() -> None:
    late = image(LAG)
    assert DepthToColour().register(late, 2.0) is late
    assert DepthToColour().register(late, KINECT) is not late


def frames_measured(turn: float, seconds: float) -> list[bool]:
    """Whether each of ten frames, ``seconds`` apart, is measured of a stream whose frames spread by ``turn`` rad."""
    stream, rng = DepthToColour(), np.random.default_rng(0)
    still = [replace(image(LAG), stamp_ns=round(1e9 * seconds * k)) for k in range(MEMORY + 10)]
    for one in still[:MEMORY]:
        stream.register(one, KINECT)
    for _ in range(40):
        stream._remember(LAG + turn * rng.normal(size=3))
    stream.spread = np.maximum(stream.spread, turn)
    return [stream.register(one, KINECT) is not one and stream.found is not None for one in still[MEMORY:]]


def test_a_stream_whose_frames_agree_is_measured_a_few_times_a_second() -> None:
    assert sum(frames_measured(0.0, 0.05)) == 2  # of ten frames in half a second
    assert all(frames_measured(0.0, 0.25))


def test_a_stream_whose_frames_differ_is_measured_in_each() -> None:
    assert all(frames_measured(0.02, 0.05))
