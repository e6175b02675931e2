# SPDX-License-Identifier: Apache-2.0
"""What stands and lies in rooms: on the boards, at the tables and along the walls."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.simulation.world import furniture
from objreg_tools.simulation.world.model import turn
from objreg_tools.simulation.world.rooms import (
    along_the_walls,
    chairs_at,
    moved_about,
    on_the_boards,
    places_of,
    table_with,
    things,
)
from objreg_tools.simulation.world.scene import footprint


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def test_things_are_of_different_classes_and_the_large_ones_come_first() -> None:
    models = things(rng(), 6, 2)
    radii = [model.radius for model in models]
    assert len(models) == 8 and radii == sorted(radii, reverse=True)
    assert len({model.label for model in models}) >= 7


def test_what_is_on_a_table_stands_at_its_height_wherever_the_table_is() -> None:
    table, T = furniture.table(rng(), (1.4, 0.8)), turn("z", 30.0)
    T[:2, 3] = [3.0, -1.0]
    laid = table_with(rng(), table, T, things(rng(), 4, 0), occluders=2)
    assert len(laid) >= 4
    for model, P in laid:
        lowest = (model.mesh.vertices @ P[:3, :3].T + P[:3, 3])[:, 2].min()
        assert lowest == pytest.approx(table.boards[0][2], abs=5e-3)
        assert np.linalg.norm(P[:2, 3] - T[:2, 3]) < table.floor_radius


def test_chairs_stand_on_the_floor_at_both_long_sides() -> None:
    chairs = chairs_at(rng(), furniture.table(rng(), (1.4, 0.8)), np.eye(4), 2)
    assert sorted(np.sign(P[1, 3]) for _, P in chairs) == [-1, 1]
    assert all(0.4 < abs(P[1, 3]) < 0.9 for _, P in chairs)


def test_furniture_has_its_back_to_its_wall() -> None:
    spots = [(degrees, along, 3.0) for degrees in (0, 90, 180, 270) for along in (-1.2, 1.2)]
    pieces = along_the_walls(rng(), spots)
    assert 3 <= len(pieces) <= len(spots)
    for piece, T in pieces:
        outwards = piece.mesh.vertices @ (T[:3, :3].T @ T[:3, :3])[1] + (T[:3, :3].T @ T[:3, 3])[1]
        assert outwards.max() == pytest.approx(2.98, abs=1e-3)


def test_there_are_things_on_the_boards_of_what_has_any() -> None:
    shelf, sofa = furniture.shelf(rng()), furniture.sofa(rng())
    assert len(on_the_boards(rng(), [(shelf, np.eye(4))])) >= 2
    assert on_the_boards(rng(), [(sofa, np.eye(4))]) == []


def test_a_place_is_just_above_the_top_of_its_table() -> None:
    table, T = furniture.table(rng(), (1.4, 0.8)), turn("z", 90.0)
    T[:2, 3] = [2.0, 1.0]
    place = places_of([(table, T)])[0]
    np.testing.assert_allclose(place.centre, [2.0, 1.0, table.boards[0][2] + 0.08])
    assert place.reach == pytest.approx(0.67)


def test_a_third_of_what_is_laid_is_moved_to_free_spots_of_the_boards() -> None:
    table, shelf, T = furniture.table(rng(), (1.6, 0.9)), furniture.shelf(rng()), np.eye(4)
    T[:2, 3] = [3.0, 0.0]
    laid = table_with(rng(), table, np.eye(4), things(rng(), 6, 0), 0) + chairs_at(rng(), table, np.eye(4), 2)
    now = moved_about(rng(), laid, [(table, np.eye(4)), (shelf, T)], [(table, np.eye(4))])
    before = {id(model): P for model, P in laid}
    moved = [(model, P) for model, P in now if P is not before[id(model)]]
    assert len(moved) + len(laid) - len(now) == round(len(laid) / 3) and moved
    for model, P in moved:
        assert np.linalg.norm(P[:3, 3] - before[id(model)][:3, 3]) >= 0.4
        at, radius = footprint(model, P)
        near = [footprint(m, Q) for m, Q in now if m is not model and abs(Q[2, 3] - P[2, 3]) < 0.3]
        assert all(np.linalg.norm(at - other) > radius + reach for other, reach in near)


def test_what_finds_no_spot_is_taken_away() -> None:
    table = furniture.table(rng(), (1.4, 0.8))
    small = furniture.Furniture(table.mesh, ((0.0, 0.0, 0.7, 0.01, 0.01),), 0.5)
    laid = table_with(rng(), table, np.eye(4), things(rng(), 6, 0), 0)
    now = moved_about(rng(), laid, [(small, np.eye(4))], [(table, np.eye(4))])
    assert len(now) == len(laid) - round(len(laid) / 3)
