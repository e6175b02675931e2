# SPDX-License-Identifier: Apache-2.0
"""Chairs: feet on the floor, a seat to sit on, a back behind it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.raster import rasterise
from objreg_tools.simulation.world.chair import chair
from objreg_tools.simulation.world.mesh import Mesh
from objreg_tools.simulation.world.model import ObjectModel

ABOVE_M = 3.0
DOWN = looking(np.array([0.0, 0.0, ABOVE_M]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
CAMERA = Intrinsics(fx=200.0, fy=200.0, cx=99.5, cy=99.5, width=200, height=200)
SEEDS = range(12)
FOOT_M = 0.15  # what is nearer to each other on the floor is of one foot


@cache
def made(seed: int) -> ObjectModel:
    return chair(np.random.default_rng(seed))


def feet(mesh: Mesh) -> np.ndarray:
    """The middles (N, 2) of what touches the floor."""
    rest, middles = mesh.vertices[mesh.vertices[:, 2] < 0.005, :2].astype(float), []
    while len(rest):
        near = np.linalg.norm(rest - rest[0], axis=1) < FOOT_M
        middles.append(rest[near].mean(axis=0))
        rest = rest[~near]
    return np.array(middles)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_chair_stands_upright_on_the_floor_and_has_no_symmetry(seed: int) -> None:
    model = made(seed)
    assert model.label == "chair" and model.on_floor and model.rests == ()
    assert model.mesh.bounds[0, 2] == pytest.approx(0.0, abs=2e-3) and 0.7 < model.size[2] < 1.4
    assert model.symmetry.axis is None and model.symmetry.turns is None
    assert model.symmetry.centre == pytest.approx([0.0, 0.0, model.size[2] / 2], abs=2e-3)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_chair_has_four_legs_in_a_rectangle_or_five_castors_in_a_star(seed: int) -> None:
    places = feet(made(seed).mesh)
    if len(places) == 4:
        assert np.ptp(np.abs(places), axis=0).max() < 0.01
        assert len({(x > 0, y > 0) for x, y in places}) == 4
    else:
        angles = np.sort(np.degrees(np.arctan2(places[:, 1], places[:, 0])))
        np.testing.assert_allclose(np.diff(angles), [72.0] * 4, atol=3.0)


def test_chairs_of_every_style_are_made() -> None:
    shells = {seed for seed in SEEDS if made(seed).mesh.open_surface.any()}
    swivels = {seed for seed in SEEDS if len(feet(made(seed).mesh)) == 5}
    assert shells and swivels and not shells & swivels and shells | swivels < set(SEEDS)


@pytest.mark.parametrize("seed", SEEDS)
def test_one_sits_as_high_as_on_a_real_chair_and_the_back_is_behind(seed: int) -> None:
    mesh = made(seed).mesh
    depth, _ = rasterise(mesh.vertices, mesh.faces, mesh.open_surface, DOWN, CAMERA)
    seat = ABOVE_M - np.median(depth[95:108, 95:105])
    assert 0.4 < seat < 0.63
    back = mesh.vertices[mesh.vertices[:, 2] > mesh.bounds[1, 2] - 0.08]
    assert back[:, 1].min() > 0.1  # the seat is open to -y


def test_a_chair_follows_from_its_generator() -> None:
    again, other = chair(np.random.default_rng(1)), made(2)
    assert np.array_equal(made(1).mesh.vertices, again.mesh.vertices)
    pictures = [np.concatenate([m.texture.ravel() for m in model.mesh.materials]) for model in (made(1), again, other)]
    assert np.array_equal(pictures[0], pictures[1]) and not np.array_equal(pictures[0], pictures[2])
