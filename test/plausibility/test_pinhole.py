# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import pytest

from objreg_ros.data import Intrinsics
from objreg_ros.plausibility.pinhole import differ, implausible, likelier

KINECT = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480)


@pytest.mark.parametrize(
    "camera",
    [
        KINECT,
        replace(KINECT, cx=20.0, cy=400.0),  # cut out of a larger picture
        Intrinsics(fx=504.0, fy=504.0, cx=511.5, cy=511.5, width=1024, height=1024),
        Intrinsics(fx=3000.0, fy=3000.0, cx=959.5, cy=539.5, width=1920, height=1080),
    ],
)
def test_cameras_that_see_rooms_are_plausible(camera: Intrinsics) -> None:
    assert implausible(camera) == ""


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"cx": -5.0}, "principal point"),
        ({"cy": 500.0}, "principal point"),
        ({"fx": 60.0, "fy": 60.0}, "focal length"),
        ({"fx": 5250.0, "fy": 5250.0}, "focal length"),
        ({"fx": 525.0, "fy": 1050.0}, "square"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_with_what_was_expected_and_got(
    changes: dict[str, float], says: str
) -> None:
    why = implausible(replace(KINECT, **changes))
    assert says in why and "expected" in why and "got" in why


def test_cameras_are_two_where_they_differ_by_more_than_calibrations_of_one_do() -> None:
    assert not differ(KINECT, replace(KINECT, fx=530.0, cx=322.0))
    assert differ(KINECT, replace(KINECT, fx=570.0, fy=570.0)) and differ(KINECT, replace(KINECT, cy=260.0))


def test_of_two_cameras_the_one_that_can_be_is_likelier_and_then_the_first() -> None:
    outside, aside = replace(KINECT, cx=900.0), replace(KINECT, cx=159.5, cy=119.5)
    assert likelier(outside, KINECT) is KINECT and likelier(aside, KINECT) is KINECT
    other = replace(KINECT, fx=600.0, fy=600.0)
    assert likelier(KINECT, other) is KINECT and likelier(other, KINECT) is other
