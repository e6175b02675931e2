# SPDX-License-Identifier: Apache-2.0
"""Camera poses from eye and target, and shadow maps."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import is_rigid
from objreg_tools.simulation.rendering.light import FAR_ABOVE_M, Lamp, looking, shadow_maps
from objreg_tools.simulation.rendering.surfaces import flatten
from objreg_tools.simulation.world.mesh import Material, box

GREY = Material(np.full((4, 4, 3), 128, np.uint8))


def test_a_camera_looks_at_its_target_with_up_upwards() -> None:
    T = looking(np.array([1.0, 2.0, 1.5]), np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.0, 1.0]))
    target = np.linalg.inv(T) @ [0.0, 0.0, 0.5, 1.0]
    np.testing.assert_allclose(target[:2], 0.0, atol=1e-12)
    assert is_rigid(T) and target[2] == pytest.approx(np.sqrt(6.0)) and T[2, 1] < 0 and abs(T[2, 0]) < 1e-12


def test_the_map_from_above_holds_the_heights() -> None:
    floor, block = box((6, 6, 0.1), GREY).moved(z=-0.1), box((1.0, 1.0, 0.5), GREY)
    s = flatten([floor, block], [0, 1], [True, True])
    maps = shadow_maps(s, (Lamp(np.array([0.0, 0.0, 2.5]), np.ones(3)),), np.zeros(3), reach=2.0, size=256)
    assert maps.moments.shape == (2, 256, 256, 2) and maps.reference[0] == FAR_ABOVE_M
    assert maps.moments[0, 128, 128, 0] == pytest.approx(-0.5, abs=0.01)
    assert maps.moments[0, 128, 20, 0] == pytest.approx(0.0, abs=0.01)


def test_what_casts_no_shadow_is_in_no_map() -> None:
    floor, ceiling = box((6, 6, 0.1), GREY).moved(z=-0.1), box((6, 6, 0.1), GREY).moved(z=2.7)
    s = flatten([floor, ceiling], [0, 0], [True, False])
    maps = shadow_maps(s, (), np.zeros(3), reach=2.0, size=64)
    np.testing.assert_allclose(maps.moments[0, ..., 0], 0.0, atol=0.01)
