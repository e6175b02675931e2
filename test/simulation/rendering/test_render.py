# SPDX-License-Identifier: Apache-2.0
"""Renderings: known distances, boxes, visibility, determinism."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.light import Lamp, looking
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.model import ObjectModel, half_turns
from objreg_tools.simulation.world.scene import Placed, Scene, random_scene, random_view

SMALL = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)
GREY = Material(np.full((4, 4, 3), 128, np.uint8))


def cube(edge: float) -> ObjectModel:
    return ObjectModel("book", box((edge, edge, edge), GREY), half_turns(np.array([0, 0, edge / 2])))


def scene_of(*centres: tuple[float, float, float], edge: float = 0.2) -> Scene:
    floor = box((20.0, 20.0, 0.1), GREY).moved(z=-0.1)
    lamp = Lamp(np.array([0.0, -1.0, 3.0]), np.ones(3))
    placed = []
    for k, centre in enumerate(centres):
        T = np.eye(4)
        T[:3, 3] = centre
        placed.append(Placed(k + 1, cube(edge), T))
    return Scene(tuple(placed), (floor,), (lamp,), np.full(3, 0.4))


def level_view() -> np.ndarray:
    return looking(np.array([0.0, -1.0, 0.1]), np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 1.0]))


def test_a_cube_seen_from_in_front_has_the_depth_and_the_box_that_the_pinhole_gives() -> None:
    image = render(scene_of((0.0, 0.0, 0.0)), level_view(), SMALL, with_colour=False)
    assert image.true_depth[60, 80] == pytest.approx(0.9, abs=1e-5)
    half = 131.25 * 0.1 / 0.9
    np.testing.assert_allclose(image.objects[0].xyxy, [79.5 - half, 59.5 - half, 79.5 + half, 59.5 + half], atol=1.0)
    assert image.objects[0].visibility == pytest.approx(1.0, abs=0.03)


def test_a_cube_half_hidden_by_a_nearer_one_is_half_visible() -> None:
    image = render(scene_of((0.0, 0.0, 0.0), (0.1, -0.25, 0.0)), level_view(), SMALL, with_colour=False)
    hidden = next(o for o in image.objects if o.instance == 1)
    assert 0.3 < hidden.visibility < 0.7


def test_a_cube_half_outside_the_image_is_half_visible() -> None:
    aside = 0.9 * 79.5 / 131.25
    image = render(scene_of((aside, 0.0, 0.0)), level_view(), SMALL, with_colour=False)
    assert image.objects[0].xyxy[2] == 160
    assert 0.4 < image.objects[0].visibility < 0.75  # its near side face is inside the image


def test_the_pose_of_an_object_in_the_camera_puts_it_where_the_depth_is() -> None:
    image = render(scene_of((0.05, 0.0, 0.0)), level_view(), SMALL, with_colour=False)
    centre = image.objects[0].T_camera_object @ [0.0, 0.0, 0.1, 1.0]
    np.testing.assert_allclose(centre[:3], [0.05, 0.0, 1.0], atol=1e-9)


def test_the_same_seed_gives_the_same_bytes_in_any_number_of_threads_and_another_seed_others() -> None:
    scene = random_scene(3)
    view = random_view(scene, 4)
    first, second = (render(scene, view, SMALL, seed=5, threads=n) for n in (1, 2))
    assert first.rgb is not None and second.rgb is not None
    assert first.depth.tobytes() == second.depth.tobytes()
    assert first.rgb.tobytes() == second.rgb.tobytes()
    assert render(scene, view, SMALL, seed=6).depth.tobytes() != first.depth.tobytes()
    again = render(random_scene(3), view, SMALL, seed=5)
    assert again.rgb is not None and again.rgb.tobytes() == first.rgb.tobytes()


def test_every_visible_object_has_its_box_tight_around_its_mask() -> None:
    scene = random_scene(11)
    image = render(scene, random_view(scene, 2), SMALL, with_colour=False)
    for o in image.seen:
        rows, columns = np.nonzero(image.instance == o.instance)
        assert o.xyxy.tolist() == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert o.pixels == len(rows)


def test_an_empty_scene_shows_nothing_and_says_so() -> None:
    scene = Scene((), (box((1.0, 1.0, 0.1), GREY),), (), np.full(3, 0.5))
    up = looking(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.5, 5.0]), np.array([0.0, 0.0, 1.0]))
    image = render(scene, up, SMALL)
    assert image.seen == () and not image.depth.any() and not image.instance.any()
