# SPDX-License-Identifier: Apache-2.0
"""How noisy the depth of a stream is and how late: a camera that turns to and fro before boards on a wall."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import rotation_from_vector
from objreg_ros.segmenter.sensor.sensor_estimate import (
    FLOOR_MS,
    MOST_SIGMA_MS,
    NOISE_EVERY,
    Lag,
    PictureMotion,
    SensorEstimate,
    TurnSample,
    fit_lag,
)
from objreg_ros.sensor import depth_sigma

CAMERA = Intrinsics(fx=262.5, fy=262.5, cx=159.5, cy=119.5, width=320, height=240)
WALL = 2.5  # m
BOARDS = (  # left, top, width, height, depth in m
    (-0.9, -0.5, 0.45, 0.3, 1.5),
    (0.1, -0.45, 0.3, 0.5, 1.4),
    (-0.4, 0.05, 0.5, 0.25, 1.7),
    (0.45, 0.2, 0.35, 0.3, 1.3),
)
RATE = 15.0  # Hz
PRINT = cv2.GaussianBlur(np.random.default_rng(5).normal(0.0, 120.0, (400, 600)).astype(np.float32), (0, 0), 3.0)


def turned_at(seconds: float) -> Array:
    """Where the camera looks, a rotation vector (3,) rad: fastest at 0.5 rad/s."""
    return np.array([0.06 * np.sin(4.1 * seconds), 0.12 * np.sin(2.9 * seconds + 1.0), 0.0])


def seen(rotation: Array) -> tuple[Array, Array]:
    """Depth and shade (H, W) of a camera turned by ``rotation (3,)`` rad."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    ray = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    ray = ray @ rotation_from_vector(rotation).T
    across, down = ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2]
    where = (300 + 280 * across).astype(np.float32), (200 + 280 * down).astype(np.float32)
    reach, shade = WALL / ray[..., 2], 60.0 + cv2.remap(PRINT, *where, cv2.INTER_LINEAR)
    for k, (x, y, width, height, z) in enumerate(BOARDS):
        px, py = z * across - x, z * down - y
        hit = (px >= 0.0) & (px <= width) & (py >= 0.0) & (py <= height)
        reach, shade = np.where(hit, z / ray[..., 2], reach), np.where(hit, 150.0 + 25.0 * k, shade)
    return reach.astype(np.float32), shade


def stream(lag_ms: float, count: int = 120, speed: float = 1.0) -> list[DepthImage]:
    """Frames of which depth shows what was there ``lag_ms`` before colour, with a Kinect's noise."""
    images, rng = [], np.random.default_rng(0)
    for k in range(count):
        seconds = k / RATE
        now, before = (speed * turned_at(t) for t in (seconds, seconds - 1e-3 * lag_ms))
        (depth, _), (_, shade) = seen(before), seen(now)
        depth = depth + rng.normal(size=depth.shape) * depth_sigma(depth)
        rgb = np.repeat(np.clip(shade, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
        images.append(
            DepthImage(depth=depth.astype(np.float32), rgb=rgb, intrinsics=CAMERA, stamp_ns=round(1e9 * seconds))
        )
    return images


def estimate_of(images: list[DepthImage]) -> SensorEstimate:
    estimate = SensorEstimate()
    for image in images:
        estimate.register(image)
    return estimate


@pytest.mark.parametrize(("lag_ms", "speed"), [(25.0, 1.0), (25.0, 0.4), (-20.0, 1.0), (0.0, 1.0)])
def test_the_lag_of_depth_is_measured_within_ten_milliseconds(lag_ms: float, speed: float) -> None:
    lag = estimate_of(stream(lag_ms, speed=speed)).lag
    assert lag is not None and lag.sigma_ms <= MOST_SIGMA_MS
    assert lag.ms == pytest.approx(lag_ms, abs=10.0)


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_a_camera_that_hardly_turns_gives_no_lag(speed: float) -> None:
    estimate = estimate_of(stream(25.0, speed=speed))
    assert estimate.lag is None


def test_too_few_frames_give_no_lag() -> None:
    assert estimate_of(stream(25.0, count=20)).lag is None


def turns(lag_ms: float, scatter: float, count: int = 300) -> list[TurnSample]:
    rng = np.random.default_rng(1)
    velocity = 0.3 * rng.normal(size=(count, 2))
    offset = np.array([0.01, -0.004]) - 1e-3 * lag_ms * velocity + scatter * rng.normal(size=(count, 2))
    return [TurnSample(k / RATE, velocity[k], offset[k]) for k in range(count)]


def test_a_wrong_calibration_is_no_lag() -> None:
    lag = fit_lag(turns(25.0, 0.001))
    assert lag is not None and lag.ms == pytest.approx(25.0, abs=1.0) and lag.sigma_ms < FLOOR_MS + 0.5
    none = fit_lag(turns(0.0, 0.001))
    assert none is not None and none.ms == pytest.approx(0.0, abs=1.0)


def test_offsets_that_scatter_make_the_lag_less_sure() -> None:
    sure, unsure = fit_lag(turns(25.0, 0.001)), fit_lag(turns(25.0, 0.1))
    assert sure is not None and unsure is not None and unsure.sigma_ms > 2.0 * sure.sigma_ms


def test_frames_that_err_hardly_move_the_lag() -> None:
    wrong = turns(25.0, 0.001)
    for k in range(0, len(wrong), 10):
        wrong[k] = wrong[k]._replace(offset=wrong[k].offset + 0.5 * wrong[k].velocity)
    lag = fit_lag(wrong)
    assert lag is not None and lag.ms == pytest.approx(25.0, abs=2.0)


def velocity_after(motion: PictureMotion, image: DepthImage) -> Array | None:
    """The velocity at the frame before this one."""
    motion.see(image)
    return motion.velocity()


def test_a_picture_moves_against_the_turn_of_its_camera() -> None:
    motion, images = PictureMotion(), stream(0.0, count=12)
    seen_of = [velocity_after(motion, image) for image in images]
    for k in range(1, len(images) - 1):
        velocity = seen_of[k + 1]
        assert velocity is not None
        true = (turned_at((k + 1) / RATE) - turned_at((k - 1) / RATE)) * RATE / 2.0
        assert velocity == pytest.approx(true[:2], abs=0.04)


def test_no_velocity_is_given_across_a_gap_or_as_time_goes_back() -> None:
    images = stream(0.0, count=4)
    for stamp_ns in (10_000_000_000, 0):
        motion = PictureMotion()
        velocities = [velocity_after(motion, image) for image in (*images[:3], replace(images[3], stamp_ns=stamp_ns))]
        assert velocities[2] is not None and velocities[3] is None


def test_a_picture_of_one_row_ends_nothing() -> None:
    camera = Intrinsics(fx=500.0, fy=500.0, cx=960.0, cy=0.0, width=1920, height=1)
    depth, rgb = np.ones((1, 1920), np.float32), np.zeros((1, 1920, 3), np.uint8)
    motion = PictureMotion()
    for stamp_ns in range(0, 300_000_000, 33_000_000):
        image = DepthImage(depth=depth, rgb=rgb, intrinsics=camera, stamp_ns=stamp_ns)
        assert velocity_after(motion, image) is None


def test_the_noise_of_depth_is_given_in_a_kinects() -> None:
    plain = replace(stream(0.0, count=1, speed=0.0)[0], rgb=None)
    flat = np.full(plain.depth.shape, 2.0)
    rng = np.random.default_rng(2)
    estimate = SensorEstimate()
    assert estimate.noise is None
    for k in range(3 * NOISE_EVERY):
        depth = (flat + 3.0 * depth_sigma(flat) * rng.normal(size=flat.shape)).astype(np.float32)
        estimate.register(replace(plain, depth=depth, stamp_ns=k))
    assert estimate.noise == pytest.approx(3.0 / 1.25, rel=0.1)
    assert estimate.lag is None and not estimate.depth_to_colour.text()


def test_frames_without_depth_give_no_noise() -> None:
    empty = replace(stream(0.0, count=1)[0], depth=np.zeros((240, 320), np.float32), rgb=None)
    assert estimate_of([empty]).noise is None


def test_another_camera_begins_anew() -> None:
    images = stream(25.0)
    estimate = estimate_of(images)
    estimate.register(replace(images[-1], frame_id="another", depth=np.zeros((240, 320), np.float32)))
    assert estimate.lag is None and estimate.noise is None


def test_what_is_forgotten_is_not_reported() -> None:
    estimate = estimate_of(stream(25.0))
    assert estimate.noise is not None and estimate.lag is not None and estimate.depth_to_colour.text()
    estimate.forget_stream()
    assert estimate.noise is None and estimate.lag is None and estimate.depth_to_colour.frames == 0


def test_a_lag_is_said_with_its_deviation() -> None:
    assert Lag(24.6, 3.2).text() == "25 +- 3 ms"
