# SPDX-License-Identifier: Apache-2.0
"""Colour from light: textures where they belong, lamps, shadows, highlights, mip levels."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.light import Lamp, looking
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.shade import LIGHT_SCALE, shade
from objreg_tools.simulation.world.mesh import Material, Mesh, box
from objreg_tools.simulation.world.model import ObjectModel, Symmetry
from objreg_tools.simulation.world.scene import Placed, Scene

CAMERA = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)
UP = np.array([0.0, 0.0, 1.0])
WHITE = Material(np.full((4, 4, 3), 255, np.uint8), specular=0.0)
DOWN = looking(np.array([0.0, -1e-3, 2.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]))


def light_on(scene: Scene, T: np.ndarray = DOWN) -> np.ndarray:
    """(H, W, 3) float64: the linear light of every pixel."""
    s = scene.surfaces
    projection = Projection(s.vertices, s.faces, s.open_surface, T, CAMERA)
    shape = (CAMERA.height, CAMERA.width)
    nearness, triangle = np.empty(shape, np.float32), np.empty(shape, np.int32)
    projection.fill(nearness, triangle, 0, CAMERA.height)
    out = np.empty((*shape, 3), np.uint16)
    shade(projection, nearness, triangle, s, T, scene.lamps, scene.ambient, scene.shadows, (0, CAMERA.height), out)
    return (out / LIGHT_SCALE) ** 2


def floor(material: Material = WHITE) -> Mesh:
    return box((8.0, 8.0, 0.1), material).moved(z=-0.1)


def scene_of(*things: Mesh, lamps: tuple[Lamp, ...] = (), ambient: float = 0.0, ground: Material = WHITE) -> Scene:
    placed = tuple(Placed(k + 1, ObjectModel("book", m, Symmetry()), np.eye(4)) for k, m in enumerate(things))
    return Scene(placed, (floor(ground),), lamps, np.full(3, ambient), middle=np.zeros(3), reach=2.0)


def test_light_from_everywhere_is_the_same_everywhere_in_the_open() -> None:
    light = light_on(scene_of(ambient=0.5))
    np.testing.assert_allclose(light, 0.5, atol=0.005)


def test_a_lamp_two_metres_above_gives_its_colour() -> None:
    lamp = Lamp(np.array([0.0, 0.0, 2.0]), np.array([0.8, 0.5, 0.2]))
    middle = light_on(scene_of(lamps=(lamp,)))[55:65, 75:85].mean(axis=(0, 1))
    np.testing.assert_allclose(middle, [0.8, 0.5, 0.2], atol=0.01)


def test_a_lamp_from_the_side_gives_less_by_the_cosine_and_the_distance() -> None:
    lamp = Lamp(np.array([1.5, 0.0, 2.0]), np.ones(3))
    square = 1.5**2 + 2.0**2
    expected = 5 / (1 + square) * 2.0 / np.sqrt(square)
    assert light_on(scene_of(lamps=(lamp,)))[60, 80, 0] == pytest.approx(expected, abs=0.02)


def test_a_block_throws_its_shadow_away_from_the_lamp() -> None:
    lamp = Lamp(np.array([-1.5, 0.0, 2.0]), np.ones(3))
    light = light_on(scene_of(box((0.2, 0.2, 0.4), WHITE), lamps=(lamp,)))
    beside = 131.25 / 2.0 * 0.2  # px, 20 cm from the middle on the ground
    assert light[60, int(80 + beside), 0] < 0.15
    assert light[60, int(80 - 1.5 * beside), 0] > 0.5


def test_corners_under_things_get_less_light_from_everywhere() -> None:
    roof = box((0.6, 0.6, 0.02), WHITE).moved(z=0.5)
    below = looking(np.array([0.0, -1.5, 0.3]), np.array([0.0, 0.0, 0.02]), UP)
    plain, covered = (light_on(scene_of(*things, ambient=0.5), below) for things in ((), (roof,)))
    assert covered[60, 80, 0] < 0.7 * plain[60, 80, 0]


def test_a_texture_lies_the_right_way_up_and_round() -> None:
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:4, :4] = (255, 0, 0)  # top left red
    picture[:4, 4:] = (0, 255, 0)  # top right green
    picture[4:, :4] = (0, 0, 255)  # bottom left blue
    card = box((0.6, 0.05, 0.6), Material(picture, specular=0.0))
    front = looking(np.array([0.0, -1.0, 0.3]), np.array([0.0, 0.0, 0.3]), UP)
    light = light_on(scene_of(card, ambient=1.0), front)
    quarter = {"red": light[45, 65], "green": light[45, 95], "blue": light[75, 65], "none": light[75, 95]}
    assert [int(np.argmax(quarter[name])) for name in ("red", "green", "blue")] == [0, 1, 2]
    assert quarter["none"].max() < 0.05


def test_a_fine_pattern_becomes_its_mean_far_away() -> None:
    i, j = np.indices((64, 64))
    chequered = np.repeat((((i + j) % 2) * 255)[..., None], 3, axis=2).astype(np.uint8)
    light = light_on(scene_of(ambient=1.0, ground=Material(chequered, specular=0.0)))
    near = np.sqrt(light[..., 0])
    assert near.mean() == pytest.approx(0.5, abs=0.04)
    fine = box((8.0, 8.0, 0.1), Material(chequered, specular=0.0), tile=0.1).moved(z=-0.1)
    far = Scene((), (fine,), (), np.ones(3), middle=np.zeros(3))
    assert np.sqrt(light_on(far)[..., 0]).std() < 0.1


def test_a_glossy_surface_mirrors_the_lamp_and_a_dull_one_does_not() -> None:
    lamp = Lamp(np.array([0.0, 0.5, 2.0]), np.ones(3))
    view = looking(np.array([0.0, -0.5, 2.0]), np.zeros(3), UP)
    dull, glossy = (
        light_on(scene_of(lamps=(lamp,), ground=Material(WHITE.texture, specular=specular, gloss=6)), view)
        for specular in (0.0, 0.6)
    )
    extra = (glossy - dull)[..., 0]
    assert extra.max() > 0.5
    assert np.unravel_index(extra.argmax(), extra.shape) == pytest.approx((60, 80), abs=4)


def test_what_shines_by_itself_needs_no_lamp() -> None:
    screen = Material(WHITE.texture, emission=0.7)
    assert light_on(scene_of(ground=screen))[60, 80, 0] == pytest.approx(0.7, abs=0.01)


def test_where_nothing_is_there_is_no_light() -> None:
    sky = looking(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.5, 5.0]), np.array([0.0, 1.0, 0.0]))
    assert not light_on(scene_of(ambient=1.0), sky).any()
