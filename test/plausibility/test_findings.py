# SPDX-License-Identifier: Apache-2.0
"""What is said of a stream names what was measured, and what to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import mounting
from objreg_ros.plausibility import findings
from objreg_ros.plausibility.camera_fit import CameraFit
from objreg_ros.plausibility.hand_eye import HandEye
from plausibility.moving import CAMERA, MOUNT

FIT = CameraFit(
    9, 0.8, 0.05, np.array([-0.12, 0.07]), np.array([0.02, 0.01]), np.tile(np.eye(4), (9, 1, 1)), np.ones(9)
)
MEASURED = HandEye(MOUNT, 1.25, 1.5, np.array([0.01, 0.02, 0.5]), 0.04, 0.2)


def test_a_focal_length_is_said_with_its_deviation_in_the_same_share() -> None:
    assert "0.80 ± 0.04 times the focal length" in findings.focal_length(FIT).what


def test_a_principal_point_is_said_in_percent_of_the_width() -> None:
    assert "-12 ± 2 % of the width to the right and 7 ± 1 % down" in findings.principal_point(FIT).what


@pytest.mark.parametrize(
    ("why", "anchor"),
    [
        ("expected a principal point inside", "camera-principal-point"),
        ("expected a focal length", "camera-focal-length"),
    ],
)
def test_a_camera_that_cannot_be_leads_to_the_section_of_its_number(why: str, anchor: str) -> None:
    found = findings.no_camera(why)
    assert found.anchor == anchor and found.what == f"camera_info: {why}"


@pytest.mark.parametrize(("is_p_used", "used"), [(True, "P is used"), (False, "K is used")])
def test_matrices_that_disagree_are_said_with_the_one_that_is_used(is_p_used: bool, used: str) -> None:
    p = Intrinsics(fx=70.0, fy=70.0, cx=39.5, cy=29.5, width=160, height=120)
    what = findings.matrices_disagree(p, CAMERA, is_p_used).what
    assert what.endswith(used)
    assert "K has a focal length of 140 px about 80, 60 and P has a focal length of 70 px about 40, 30" in what


def test_cameras_that_disagree_are_said_depth_first() -> None:
    depth = replace(CAMERA, fx=120.0, fy=120.0)
    assert "120 px about 80, 60, and 140 px about 80, 60 of colour" in findings.cameras_disagree(depth, CAMERA).what


def test_a_scale_is_said_as_the_steps_of_depth_that_make_it_right() -> None:
    found = findings.depth_scale(MEASURED)
    assert "1.25 ± 0.05 times as far" in found.what and "steps of 0.8 of" in found.cause


def test_shares_are_said_in_percent() -> None:
    assert "in 75 % of the stream" in findings.other_colour(0.75).what
    assert "in 20 % of the stream" in findings.other_robot(0.2).what


@pytest.mark.parametrize(("seconds", "said"), [(7.3, "7.30 s later"), (-0.5, "0.50 s earlier")])
def test_another_clock_is_said_without_a_sign(seconds: float, said: str) -> None:
    assert f"stamped {said} than the camera" in findings.other_clock(seconds, 0.9).what


def test_a_gap_is_said_by_what_odometry_covers() -> None:
    assert findings.odometry_gaps(0.4, 3.0, 7.5).what.startswith("40 % of the frames have odometry: it covers 3.0 of ")


def test_a_wrong_mount_is_said_with_the_one_that_was_measured() -> None:
    found = findings.mount_wrong(MEASURED, 34.4)
    assert "turned by 34°" in found.what and findings.pasted(MOUNT) in found.todo


def test_an_unknown_mount_is_said_with_what_was_measured_or_what_it_takes() -> None:
    measured = findings.mount_unknown("base_link", "camera", MEASURED, "; its z is open")
    assert measured.cause.endswith("within 1.5°; its z is open") and findings.pasted(MOUNT) in measured.todo
    unmeasured = findings.mount_unknown("base_link", "camera", None, "")
    assert unmeasured.what == measured.what and "'camera' sits on 'base_link'" in measured.what
    assert "until the mount is measured" in unmeasured.cause and "static_transform_publisher" in unmeasured.todo


def test_a_mount_that_is_pasted_into_the_parameter_is_that_mount() -> None:
    numbers = [float(number) for number in findings.pasted(MOUNT).strip("[]").split(",")]
    T_base_camera = mounting(numbers)
    assert T_base_camera is not None
    np.testing.assert_allclose(T_base_camera, MOUNT, atol=2e-4)


def test_a_pasted_mount_has_no_negative_zero() -> None:
    T = np.eye(4)
    T[0, 3] = -1e-9
    assert findings.pasted(T) == "[0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 1.0000]"
