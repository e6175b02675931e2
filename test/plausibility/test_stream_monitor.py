# SPDX-License-Identifier: Apache-2.0
"""A stream betrays by its own motion what it is not: seen in a box of speckled walls."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import JUMP_NS, Odometry
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import pose, pose_error, rotation_from_vector
from objreg_ros.plausibility.offset import offsets
from objreg_ros.plausibility.stream_monitor import LONG_S, PATIENCE_S, StreamMonitor
from plausibility.box_room import RATE_HZ, depth_and_grey, longer, odometry, seen_as, swinging
from plausibility.moving import CAMERA, MOUNT

Pictures = list[tuple[Array, Array]]
SECONDS = np.arange(0.0, 6.0, 1.0 / RATE_HZ)
ODOMETRY_SECONDS = np.arange(0.0, 6.0, 0.05)
OWN = odometry(ODOMETRY_SECONDS, swinging(ODOMETRY_SECONDS))


@pytest.fixture(scope="module")
def pictures() -> Pictures:
    return [depth_and_grey(T) for T in swinging(SECONDS)]


def watch(
    pictures: Pictures,
    camera: Intrinsics = CAMERA,
    samples: Iterable[Odometry] = (),
    mount: Array | None = MOUNT,
    scale: float = 1.0,
    monitor: StreamMonitor | None = None,
    begin_ns: int = 0,
) -> StreamMonitor:
    """The monitor once the stream has come, each sample of odometry before the first frame that is not older."""
    monitor = StreamMonitor() if monitor is None else monitor
    waiting = list(samples)
    for seconds, (depth, grey) in zip(SECONDS, pictures, strict=False):
        stamp_ns = round(1e9 * seconds)
        while waiting and waiting[0].stamp_ns <= stamp_ns:
            monitor.take_odometry(waiting.pop(0))
        view = seen_as(depth * np.float32(scale), grey, camera)
        monitor.follow_view(begin_ns + stamp_ns, view, "camera", mount, has_odometry=bool(samples))
    return monitor


def rest(monitor: StreamMonitor, picture: tuple[Array, Array], seconds: float, camera: Intrinsics = CAMERA) -> None:
    """One view a second, the last after so many, of a camera that does not move."""
    for stamp_s in [*np.arange(0.0, seconds), seconds]:
        monitor.follow_view(round(1e9 * stamp_s), seen_as(*picture, camera), "camera", None)


def anchors(monitor: StreamMonitor) -> list[str]:
    return [finding.anchor for finding in monitor.findings]


def test_a_right_camera_becomes_proven_and_nothing_is_found(pictures: Pictures) -> None:
    monitor = watch(pictures)
    assert monitor.proven and not monitor.doubt and not monitor.findings
    assert monitor.fit is not None and abs(np.log(monitor.fit.focal)) < monitor.fit.focal_sigma


def test_a_right_camera_is_not_proven_before_it_has_moved_enough(pictures: Pictures) -> None:
    assert not watch(pictures[:5]).proven


@pytest.mark.parametrize("stated", [0.75, 1.25])
def test_a_focal_length_that_is_off_by_a_quarter_is_in_doubt(pictures: Pictures, stated: float) -> None:
    monitor = watch(pictures, longer(CAMERA, stated))
    assert anchors(monitor) == ["camera-focal-length"] and not monitor.proven
    assert monitor.doubt == monitor.findings[0].what
    assert monitor.fit is not None and monitor.fit.focal * stated == pytest.approx(1.0, abs=0.03)


def test_a_principal_point_that_is_off_by_a_tenth_of_the_width_is_in_doubt(pictures: Pictures) -> None:
    monitor = watch(pictures, replace(CAMERA, cx=CAMERA.cx - 0.1 * CAMERA.width))
    assert anchors(monitor) == ["camera-principal-point"] and monitor.doubt and not monitor.proven


def test_a_camera_that_cannot_be_is_in_doubt_from_its_first_view(pictures: Pictures) -> None:
    monitor = watch(pictures[:1], replace(CAMERA, cx=-20.0))
    assert anchors(monitor) == ["camera-principal-point"] and monitor.doubt and not monitor.proven
    rest(monitor, pictures[0], LONG_S + 1.0, replace(CAMERA, cx=-20.0))
    assert monitor.doubt and not monitor.proven, "patience does not make it right"


def with_other_depth(pictures: Pictures) -> Pictures:
    """The pictures with the depth of a camera that swings elsewhere."""
    elsewhere = [depth_and_grey(T)[0] for T in swinging(SECONDS + 50.0, pace=3.0)]
    return [(depth, grey) for depth, (_, grey) in zip(elsewhere, pictures, strict=True)]


def test_colour_that_moves_otherwise_than_depth_is_of_another_camera(pictures: Pictures) -> None:
    monitor = watch(with_other_depth(pictures))
    assert anchors(monitor) == ["colour-of-another-camera"] and monitor.doubt and not monitor.proven


def test_a_camera_that_was_proven_is_so_no_more_once_it_is_in_doubt(pictures: Pictures) -> None:
    monitor = watch(pictures[:25])
    assert monitor.proven
    watch(with_other_depth(pictures), monitor=monitor, begin_ns=10**10)
    watch(with_other_depth(pictures), monitor=monitor, begin_ns=2 * 10**10)
    assert anchors(monitor) == ["colour-of-another-camera"] and not monitor.proven


def test_a_camera_at_rest_is_believed_after_patience_and_not_before(pictures: Pictures) -> None:
    monitor = StreamMonitor()
    rest(monitor, pictures[0], PATIENCE_S)
    assert not monitor.proven
    monitor.follow_view(round(1e9 * PATIENCE_S) + 1, seen_as(*pictures[0]), "camera", None)
    assert monitor.proven and not monitor.findings and monitor.fit is None


def test_the_scale_of_right_depth_is_that_of_odometry(pictures: Pictures) -> None:
    monitor = watch(pictures, samples=OWN)
    assert monitor.proven and not monitor.findings and not monitor.disowned


def test_a_camera_with_odometry_is_not_proven_before_that_shows_its_scale(pictures: Pictures) -> None:
    few = OWN[:4]
    assert watch(pictures).proven and not watch(pictures, samples=few).proven


@pytest.mark.parametrize("mount", [MOUNT, None])
def test_depth_of_1_3_times_is_found_beside_odometry(pictures: Pictures, mount: Array | None) -> None:
    monitor = watch(pictures, samples=OWN, mount=mount, scale=1.3)
    monitor.judge_rest()
    assert anchors(monitor)[0] == "depth-scale" and monitor.doubt == monitor.findings[0].what
    assert not monitor.proven and not monitor.disowned


def sliding(seconds: Array) -> Array:
    """Poses ``T_room_camera (n, 4, 4)`` of a camera that turns little: its focal length stays unknown."""
    turns = 0.08 * np.sin(seconds[:, None] * [0.9, 1.1, 0.7])
    places = np.sin(seconds[:, None] * [0.7, 0.5, 0.6]) * [0.7, 0.15, 0.1]
    return pose(rotation_from_vector(turns), places)


@pytest.fixture(scope="module")
def slid() -> Pictures:
    return [depth_and_grey(T) for T in sliding(SECONDS)]


@pytest.mark.parametrize(("scale", "expected"), [(0.8, ["depth-scale"]), (1.0, []), (1.3, ["depth-scale"])])
def test_where_the_focal_length_stays_unknown_a_wrong_scale_is_found_by_the_stated_one(
    slid: Pictures, scale: float, expected: list[str]
) -> None:
    samples = odometry(ODOMETRY_SECONDS, sliding(ODOMETRY_SECONDS))
    monitor = watch(slid, samples=samples, scale=scale)
    assert monitor.fit is not None and any(offset.is_vague for offset in offsets(monitor.fit))
    assert anchors(monitor) == expected and not monitor.proven
    assert all("or the focal length" in finding.cause for finding in monitor.findings)


def test_without_odometry_nothing_shows_the_scale_of_depth(pictures: Pictures) -> None:
    monitor = watch(pictures, scale=1.3)
    assert monitor.proven and not monitor.findings


def test_odometry_of_another_robot_is_disowned_and_the_camera_believed(pictures: Pictures) -> None:
    other = odometry(ODOMETRY_SECONDS, swinging(ODOMETRY_SECONDS + 50.0, pace=1.7))
    monitor = watch(pictures, samples=other)
    assert anchors(monitor) == ["odometry-of-another-robot"] and monitor.disowned == monitor.findings[0].what
    assert monitor.proven and not monitor.doubt


def test_a_mount_that_nothing_says_is_measured(pictures: Pictures) -> None:
    monitor = watch(pictures, samples=OWN, mount=None)
    assert anchors(monitor) == ["mount-unknown"] and monitor.T_body_camera is not None
    degrees, centimetres = pose_error(monitor.T_body_camera, MOUNT)
    assert degrees < 3.0 and centimetres < 10.0


def test_a_mount_that_is_turned_is_wrong_and_measured(pictures: Pictures) -> None:
    turned = MOUNT @ pose(rotation_from_vector(np.array([0.0, 0.6, 0.0])), np.zeros(3))
    monitor = watch(pictures, samples=OWN, mount=turned)
    assert anchors(monitor) == ["mount-wrong"] and monitor.disowned and not monitor.doubt
    assert monitor.T_body_camera is not None and pose_error(monitor.T_body_camera, MOUNT)[0] < 3.0


def test_another_camera_begins_anew(pictures: Pictures) -> None:
    wrong = longer(CAMERA, 1.25)
    monitor = watch(pictures, wrong)
    assert monitor.doubt and monitor.camera == wrong
    watch(pictures[:3], CAMERA, monitor=monitor, begin_ns=10**10)
    assert monitor.camera == CAMERA and not monitor.doubt and not monitor.findings and monitor.fit is None
    assert not monitor.proven, "what was seen of the other one proves nothing"
    assert watch(pictures, CAMERA, monitor=monitor, begin_ns=2 * 10**10).proven


def test_a_clock_that_goes_back_begins_anew_and_a_late_view_does_not(pictures: Pictures) -> None:
    late, again = (watch(pictures) for _ in range(2))
    last_ns = round(1e9 * SECONDS[-1])
    late.follow_view(last_ns - JUMP_NS + 1, seen_as(*pictures[0]), "camera", MOUNT)
    again.follow_view(last_ns - JUMP_NS, seen_as(*pictures[0]), "camera", MOUNT)
    assert late.proven and not again.proven and again.fit is None
