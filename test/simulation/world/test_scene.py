# SPDX-License-Identifier: Apache-2.0
"""Scenes: things lie on what carries them, apart from each other, and random views show something."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import is_rigid
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.world.objects import LABELS, make_object
from objreg_tools.simulation.world.scene import random_scene, random_view, some_models, spread

SMALL = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)
BOARD = (0.1, -0.2, 0.72, 0.7, 0.4)


def test_things_lie_on_the_board_and_not_beyond_it() -> None:
    rng = np.random.default_rng(0)
    laid = spread(rng, some_models(rng, 12, 0.3), BOARD)
    assert len(laid) >= 5
    for model, T in laid:
        bounds = model.mesh.placed(T).bounds
        assert bounds[0, 2] == pytest.approx(0.72, abs=3e-3)
        middle = bounds.mean(axis=0)
        assert abs(middle[0] - 0.1) < 0.7 and abs(middle[1] + 0.2) < 0.4


def test_round_things_keep_their_distance() -> None:
    rng = np.random.default_rng(1)
    laid = spread(rng, [make_object("bowl", k) for k in range(8)], BOARD, gap=0.02)
    for k, (one, T_one) in enumerate(laid):
        for other, T_other in laid[:k]:
            apart = np.linalg.norm(T_one[:2, 3] - T_other[:2, 3])
            assert apart > (one.size[0] + other.size[0]) / 2 + 0.019


def test_what_goes_beside_is_close_to_something() -> None:
    rng = np.random.default_rng(2)
    models = [make_object("cereal_box", 0), *(make_object("soda_can", k) for k in range(4))]
    laid = spread(rng, models, (0.0, 0.0, 0.7, 2.0, 2.0), beside=4)
    assert len(laid) == 5
    for k, (_, T) in enumerate(laid[1:], start=1):
        assert min(np.linalg.norm(T[:2, 3] - other[:2, 3]) for _, other in laid[:k]) < 0.35


def test_what_is_too_high_is_left_out() -> None:
    rng = np.random.default_rng(3)
    assert not spread(rng, [make_object("monitor", 0)], BOARD, clearance=0.2)
    assert spread(rng, [make_object("monitor", 0)], BOARD)


def test_random_scenes_differ_and_follow_from_their_seed() -> None:
    first, again, other = (random_scene(seed) for seed in (5, 5, 6))
    assert np.array_equal(first.surfaces.vertices, again.surfaces.vertices)
    assert np.array_equal(first.surfaces.texels, again.surfaces.texels)
    assert first.surfaces.vertices.shape != other.surfaces.vertices.shape


def test_random_views_are_rigid_in_the_room_and_most_show_an_object() -> None:
    shown, labels = 0, set()
    for seed in range(10):
        scene = random_scene(seed)
        view = random_view(scene, seed)
        assert is_rigid(view) and 0 < view[2, 3] < 2.7
        seen = [o for o in render(scene, view, SMALL, with_colour=False).objects if o.visibility > 0.25]
        shown += bool(seen)
        labels |= {o.label for o in seen}
    assert shown >= 9 and len(labels) >= 5


def test_a_scene_of_chosen_classes_has_no_others() -> None:
    scene = random_scene(4, labels=("soda_can", "bowl"), distractor_share=0.0)
    assert {o.label for o in scene.objects} <= {"soda_can", "bowl"} and scene.objects


def test_distractors_are_distinguished_from_the_nine_classes() -> None:
    scene = random_scene(7)
    assert all(o.is_distractor == (o.label not in LABELS) for o in scene.objects)
    assert [o.instance for o in scene.objects] == list(range(1, len(scene.objects) + 1))
