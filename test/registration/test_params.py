# SPDX-License-Identifier: Apache-2.0
"""What the registrar makes of its parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest

from objreg_ros.registrar.params import RegistrarNodeParams
from objreg_tools.cli.settings import NODES, names_of, read_settings


def test_a_search_may_take_as_long_as_is_set_and_without_a_limit_for_ever() -> None:
    assert RegistrarNodeParams(search_seconds=0.4).limit == 0.4
    assert RegistrarNodeParams().limit == math.inf


def test_where_the_camera_is_mounted_is_a_pose_and_nothing_is_none() -> None:
    T = RegistrarNodeParams(T_base_camera=(0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0)).mounting
    assert T is not None
    assert np.allclose(T, [[-1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
    assert RegistrarNodeParams().mounting is None


def test_a_mounting_that_cannot_be_is_refused_when_it_is_set() -> None:
    with pytest.raises(ValueError, match="expected x y z qx qy qz qw or nothing, got"):
        RegistrarNodeParams(T_base_camera=(1.0, 2.0, 3.0))


def test_a_parameter_of_the_last_release_is_refused_with_the_name_of_its_constant() -> None:
    with pytest.raises(ValueError, match=r"^waiting_megabytes: no parameter any more; .* WAITING_BYTES in objreg_ros/"):
        RegistrarNodeParams.from_mapping({"waiting_megabytes": 200})
    with pytest.raises(ValueError, match=r"^registrar: waiting_megabytes: no parameter any more; "):
        read_settings(None, ["registrar.waiting_megabytes=200"])
    assert not set(RegistrarNodeParams.DROPPED) & {name for kind in NODES["registrar"] for name in names_of(kind)}


def test_the_node_s_other_values_are_checked_too() -> None:
    with pytest.raises(ValueError, match="odom_slop: expected at least 0, got -1"):
        RegistrarNodeParams(odom_slop=-1.0)


def test_robots_are_namespaces_with_cameras_behind_them() -> None:
    params = RegistrarNodeParams(robots=("r1 front rear", "fleet/r2", ". left"))
    assert params.cameras == {"r1": ("front", "rear"), "fleet/r2": (), "": ("left",)}
    assert RegistrarNodeParams().cameras == {}


@pytest.mark.parametrize("robots", [("r1", "r1"), ("r1", "/r1"), ("1r",), ("",), ("r1 a a",), ("r1 a-b",)])
def test_what_names_no_robot_or_one_twice_is_refused(robots: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=r"robots.*: expected distinct names of namespaces"):
        RegistrarNodeParams(robots=robots)
