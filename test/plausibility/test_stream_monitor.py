# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data import Array, Intrinsics, Odometry
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.plausibility.stream_monitor import PATIENCE_S, StreamMonitor
from plausibility.spans import CAMERA
from plausibility.test_hand_eye import MOUNT
from plausibility.views import view

STEP_NS = 100_000_000
SECONDS = 18


def swaying(seed: int = 0) -> Array:
    """``T_world_camera`` at 10 Hz of a hand that looks around in the middle of the box."""
    rng = np.random.default_rng(seed)
    speed, phase = rng.uniform(0.6, 1.4, 6), rng.uniform(0, 2 * np.pi, 6)
    waves = np.sin(np.outer(0.1 * np.arange(10 * SECONDS), speed) + phase)
    turns, places = waves[:, :3] * [0.35, 0.5, 0.3], waves[:, 3:] * [0.4, 0.3, 0.4]
    return np.array([pose(rotation_from_vector(turn), place) for turn, place in zip(turns, places, strict=True)])


PATH, OTHER_PATH = swaying(), swaying(seed=1)


def followed(
    T_odom_body: Array | None = None,
    mount: Array | None = None,
    stated: Intrinsics = CAMERA,
    depth_scale: float = 1.0,
    later_ns: int = 0,
) -> StreamMonitor:
    """The monitor after the stream of `PATH`, with this odometry."""
    monitor = StreamMonitor()
    odometry = [] if T_odom_body is None else list(T_odom_body)
    for k, T in enumerate(odometry):
        monitor.take_odometry(Odometry(T_odom_body=T, stamp_ns=k * STEP_NS + later_ns))
    for k, T in enumerate(PATH):
        monitor.follow(k * STEP_NS, view(T, stated, depth_scale), "camera", mount, bool(odometry))
    monitor.finish()
    return monitor


def anchors(monitor: StreamMonitor) -> list[str]:
    return [finding.anchor for finding in monitor.findings]


BODY_PATH = PATH @ inverse(MOUNT)


def test_a_camera_that_is_as_it_says_is_believed_without_a_finding() -> None:
    for monitor in (followed(), followed(BODY_PATH, MOUNT)):
        assert monitor.proven and monitor.doubt == monitor.disowned == "" and monitor.findings == ()
        assert 1e-9 * STEP_NS * len(PATH) < PATIENCE_S


@pytest.mark.parametrize(
    ("stated", "anchor"),
    [
        (replace(CAMERA, fx=1.25 * CAMERA.fx, fy=1.25 * CAMERA.fy), "camera-focal-length"),
        (replace(CAMERA, fx=0.7 * CAMERA.fx, fy=0.7 * CAMERA.fy), "camera-focal-length"),
        (replace(CAMERA, cx=CAMERA.cx + 24.0), "camera-principal-point"),
        (replace(CAMERA, cx=CAMERA.cx + 200.0), "camera-principal-point"),
    ],
)
def test_a_camera_that_is_not_what_it_says_is_in_doubt_and_named(stated: Intrinsics, anchor: str) -> None:
    monitor = followed(stated=stated)
    assert monitor.doubt and not monitor.proven and anchor in anchors(monitor)


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.25, 2.0])
def test_depth_of_another_scale_than_odometry_is_in_doubt(factor: float) -> None:
    monitor = followed(BODY_PATH, MOUNT, depth_scale=factor)
    assert monitor.doubt and anchors(monitor) == ["depth-scale"]


def test_odometry_of_another_robot_is_not_used_and_does_not_put_the_camera_in_doubt() -> None:
    monitor = followed(OTHER_PATH @ inverse(MOUNT), MOUNT)
    assert monitor.disowned and anchors(monitor) == ["odometry-of-another-robot"] and monitor.doubt == ""


def test_odometry_of_another_clock_is_named_with_its_shift() -> None:
    monitor = followed(BODY_PATH, MOUNT, later_ns=2_000_000_000)
    assert monitor.disowned and anchors(monitor) == ["odometry-clock"] and "2.0" in monitor.findings[0].text


def test_a_mount_that_is_wrong_is_named_and_measured() -> None:
    wrong = MOUNT @ pose(rotation_from_vector(np.array([0.0, 0.8, 0.0])), np.zeros(3))
    monitor = followed(BODY_PATH, wrong)
    assert monitor.disowned and anchors(monitor) == ["mount-wrong"] and monitor.T_body_camera is not None
    assert pose_error(monitor.T_body_camera, MOUNT)[0] < 3.0


def test_a_mount_that_nobody_knows_is_measured() -> None:
    monitor = followed(BODY_PATH)
    assert anchors(monitor) == ["mount-unknown"] and monitor.T_body_camera is not None
    degrees, centimetres = pose_error(monitor.T_body_camera, MOUNT)
    assert degrees < 3.0 and centimetres < 10.0


def test_a_camera_at_rest_is_believed_after_a_while_and_not_before() -> None:
    monitor, seen = StreamMonitor(), view(np.eye(4))
    monitor.follow(0, seen, "camera", None)
    monitor.follow(round(1e9 * (PATIENCE_S - 1)), seen, "camera", None)
    assert not monitor.proven
    monitor.follow(round(1e9 * (PATIENCE_S + 1)), seen, "camera", None)
    assert monitor.proven and monitor.findings == ()


def test_another_camera_and_another_run_of_the_clock_are_looked_at_anew() -> None:
    monitor = followed()
    assert monitor.proven
    monitor.follow(STEP_NS * len(PATH), view(PATH[0], replace(CAMERA, fx=140.0)), "camera", None)
    assert not monitor.proven
    other = followed()
    other.follow(0, view(PATH[0]), "camera", None)
    assert not other.proven


def test_odometry_that_ends_early_is_a_gap() -> None:
    monitor = StreamMonitor()
    for k, T in enumerate(BODY_PATH[:60]):
        monitor.take_odometry(Odometry(T_odom_body=T, stamp_ns=k * STEP_NS))
    for k, T in enumerate(PATH):
        monitor.follow(k * STEP_NS, view(T), "camera", MOUNT, k < 60)
    monitor.finish()
    assert "odometry-gaps" in anchors(monitor)
