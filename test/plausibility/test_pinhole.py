# SPDX-License-Identifier: Apache-2.0
"""Numbers of a pinhole camera that can be, and that cannot."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from objreg_ros.data.images import Intrinsics
from objreg_ros.plausibility.pinhole import LEAST_FOCAL, MOST_ASPECT, MOST_FOCAL, SAME, differ, implausible, likelier

KINECT = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480)


def with_focal(fx: float, fy: float | None = None) -> Intrinsics:
    return replace(KINECT, fx=fx, fy=fx if fy is None else fy)


@pytest.mark.parametrize(
    "camera",
    [
        KINECT,
        replace(KINECT, width=480, height=640, cx=239.5, cy=319.5),
        Intrinsics(fx=911.0, fy=911.0, cx=650.0, cy=370.0, width=1280, height=720),  # a RealSense in colour
        Intrinsics(fx=505.0, fy=505.0, cx=510.0, cy=516.0, width=1024, height=1024),  # an Azure Kinect, wide
        replace(KINECT, cx=20.0, cy=450.0),  # cut out of a larger picture
        with_focal(525.0, 525.0 * 1.4),
    ],
)
def test_cameras_that_see_a_room_can_be(camera: Intrinsics) -> None:
    assert implausible(camera) == ""


@pytest.mark.parametrize("changed", [{"cx": -1.0}, {"cx": 640.0}, {"cy": -1.0}, {"cy": 480.0}])
def test_a_principal_point_outside_of_the_picture_cannot_be(changed: dict[str, Any]) -> None:
    assert "principal point inside of the picture of 640 × 480" in implausible(replace(KINECT, **changed))


@pytest.mark.parametrize("changed", [{"cx": -0.5}, {"cx": 639.5}, {"cy": -0.5}, {"cy": 479.5}])
def test_a_principal_point_on_the_rim_can_be(changed: dict[str, Any]) -> None:
    assert implausible(replace(KINECT, **changed)) == ""


@pytest.mark.parametrize("share", [0.99 * LEAST_FOCAL, 1.01 * MOST_FOCAL])
def test_a_focal_length_beyond_any_lens_cannot_be(share: float) -> None:
    text = implausible(with_focal(640.0 * share))
    assert "focal length of 115 to 1856 px in a picture of 640 × 480" in text and f"{640.0 * share:.1f}" in text


@pytest.mark.parametrize("share", [1.01 * LEAST_FOCAL, 0.99 * MOST_FOCAL])
def test_a_focal_length_of_the_widest_and_of_the_longest_lens_can_be(share: float) -> None:
    assert implausible(with_focal(640.0 * share)) == ""


def test_pixels_that_are_far_from_square_cannot_be() -> None:
    assert "about square" in implausible(with_focal(400.0, 400.0 * 1.01 * MOST_ASPECT))
    assert "about square" in implausible(with_focal(400.0 * 1.01 * MOST_ASPECT, 400.0))


def test_cameras_that_are_one_may_differ_a_little() -> None:
    assert not differ(KINECT, KINECT) and not differ(KINECT, with_focal(525.0 * (1 + 0.9 * SAME)))
    assert not differ(KINECT, replace(KINECT, cx=KINECT.cx + 0.9 * SAME * 640))


@pytest.mark.parametrize("other", [with_focal(580.0), with_focal(525.0, 480.0), replace(KINECT, cy=260.0)])
def test_cameras_that_differ_in_one_number_are_two(other: Intrinsics) -> None:
    assert differ(KINECT, other) and differ(other, KINECT)


def test_of_two_cameras_the_one_that_can_be_is_likelier() -> None:
    half = replace(KINECT, cx=-30.0)
    assert likelier(half, KINECT) is KINECT and likelier(KINECT, half) is KINECT


def test_of_two_cameras_the_one_about_the_middle_is_likelier() -> None:
    of_twice_the_size = replace(KINECT, fx=1050.0, fy=1050.0, cx=600.0, cy=470.0)
    assert likelier(of_twice_the_size, KINECT) is KINECT and likelier(KINECT, of_twice_the_size) is KINECT


def test_a_camera_that_is_little_nearer_to_the_middle_is_no_likelier() -> None:
    aside = replace(KINECT, cx=KINECT.cx + 40.0)
    assert likelier(aside, KINECT) is aside


def test_a_camera_about_the_middle_that_cannot_be_is_no_likelier() -> None:
    aside = replace(KINECT, cx=600.0, cy=470.0)
    assert likelier(aside, with_focal(50.0)) is aside


def test_of_two_cameras_that_can_both_be_or_neither_the_first_is_kept() -> None:
    other, wrong, worse = with_focal(580.0), replace(KINECT, cx=-30.0), replace(KINECT, cx=-90.0)
    assert likelier(KINECT, other) is KINECT and likelier(other, KINECT) is other
    assert likelier(wrong, worse) is wrong and likelier(worse, wrong) is worse
