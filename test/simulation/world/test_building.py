# SPDX-License-Identifier: Apache-2.0
"""Three rooms in a row: openings that one sees and walks through, and a table in each room."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.world.building import OPENINGS_X, REACH_M, ROOM_HALF, ROOMS_X, Building, make_building

NARROW = Intrinsics(fx=400.0, fy=400.0, cx=9.5, cy=9.5, width=20, height=20)
UP = np.array([0.0, 0.0, 1.0])


@cache
def building() -> Building:
    return make_building(np.random.default_rng(3), 0)


def depth(eye: tuple[float, ...], target: tuple[float, ...]) -> np.ndarray:
    return render(building().scene, looking(np.array(eye), np.array(target), UP), NARROW, with_colour=False).true_depth


def test_one_sees_from_end_to_end_through_both_openings() -> None:
    through = depth((-REACH_M + 0.3, 0.0, 1.6), (REACH_M, 0.0, 1.6))
    assert through.min() > OPENINGS_X[1] + REACH_M


@pytest.mark.parametrize("y", [-1.2, 1.2])
def test_beside_the_openings_are_walls(y: float) -> None:
    for x, opening in ((0.0, OPENINGS_X[0]), (0.0, OPENINGS_X[1])):
        assert depth((x, y, 2.4), (opening, y, 2.4)).max() < ROOM_HALF[0] + 0.2


def test_each_room_has_a_table_with_things_on_it_and_its_front_on_the_line_of_the_openings() -> None:
    scene = building().scene
    for x, place, front in zip(ROOMS_X, scene.places, building().fronts, strict=True):
        assert abs(place.centre[0] - x) < 0.5
        eye = place.centre[:2] + 0.9 * np.array([np.cos(np.radians(front)), np.sin(np.radians(front))])
        assert abs(eye[1]) < abs(place.centre[1])
        near = [o for o in scene.objects if np.linalg.norm(o.T_world_object[:3, 3] - place.centre) < place.reach]
        assert len(near) >= 4


def test_each_room_has_a_lamp_of_its_own() -> None:
    assert [round(float(lamp.position[0] / ROOMS_X[-1])) for lamp in building().scene.lamps] == [-1, 0, 1]
