# SPDX-License-Identifier: Apache-2.0
"""What the mapper makes of its parameters."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.params import MapperNodeParams, MapperParams


def test_the_errors_of_odometry_are_in_metres_and_radians() -> None:
    params = MapperParams(odometry_translation_error=0.05, odometry_rotation_error=18.0)
    assert params.odometry_sigmas == pytest.approx((0.05, np.pi / 10))


def test_what_is_steadily_wrong_is_a_turn_in_radians_and_as_much_along_the_way_as_across() -> None:
    assert MapperParams(steady_heading=18.0, steady_distance=0.03).steady == pytest.approx((np.pi / 10, 0.03, 0.03))
    assert MapperParams(steady_heading=0.0, steady_distance=0.0).steady == Steady()


def test_where_the_camera_is_mounted_is_a_pose_and_nothing_is_where_the_body_is() -> None:
    T = MapperNodeParams(T_base_camera=(0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0)).mounting
    assert np.allclose(T, [[-1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
    assert MapperNodeParams().mounting is None


def test_a_mounting_that_cannot_be_is_refused_when_it_is_set() -> None:
    with pytest.raises(ValueError, match="expected x y z qx qy qz qw or nothing, got"):
        MapperNodeParams(T_base_camera=(1.0, 2.0, 3.0))


def test_the_node_s_other_values_are_checked_too() -> None:
    with pytest.raises(ValueError, match="map_frame: expected str, got 3"):
        MapperNodeParams(map_frame=3)  # type: ignore[arg-type]


@pytest.mark.parametrize("robots", [("a", "a"), ("",), ("a b",), ("a/",), ("1st",)])
def test_robots_are_distinct_namespaces(robots: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="robots: expected distinct names of namespaces"):
        MapperNodeParams(robots=robots)
    assert MapperNodeParams(robots=("a", "fleet/b_2", "/c")).robots == ("a", "fleet/b_2", "/c")


def test_a_floor_that_a_user_could_set_before_is_refused_with_what_took_its_place() -> None:
    with pytest.raises(ValueError, match="min_sigma_rotation: no parameter any more; it is LEAST_SIGMAS"):
        MapperParams.from_mapping({"min_sigma_rotation": 0.1})


def test_our_own_tracking_is_believed_less_than_odometry_and_errs_by_nothing_steady() -> None:
    usual, tracked = MapperParams(), MapperParams.of_tracking()
    assert all(a > b for a, b in zip(tracked.odometry_sigmas, usual.odometry_sigmas, strict=True))
    assert not any(tracked.steady) and tracked.keyframe_translation == usual.keyframe_translation
