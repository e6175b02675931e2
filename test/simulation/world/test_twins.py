# SPDX-License-Identifier: Apache-2.0
"""Twin places: equal but for one thing."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.scenarios import make_plan, twins_of
from objreg_tools.simulation.trajectory import UP
from objreg_tools.simulation.world.twins import KINDS, T_SECOND_FIRST, Twins

SMALL = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)
SEEDS = {"book": 104, "poster": 0, "chair": 2}
of_kind = cache(lambda kind: twins_of(SEEDS[kind]))


@pytest.mark.parametrize("kind", KINDS)
def test_both_places_have_the_same_things_where_they_are_but_for_one(kind: str) -> None:
    twins: Twins = of_kind(kind)
    assert twins.kind == kind
    objects, half = twins.scene.objects, len(twins.scene.objects) // 2
    assert 2 * half == len(objects)
    other = [
        (a.label, k)
        for k, (a, b) in enumerate(zip(objects[:half], objects[half:], strict=True))
        if a.model is not b.model or not np.allclose(T_SECOND_FIRST @ a.T_world_object, b.T_world_object)
    ]
    assert [label for label, _ in other] == ([] if kind == "poster" else [kind])


@pytest.mark.parametrize("kind", KINDS)
def test_they_look_different_only_where_that_thing_is(kind: str) -> None:
    twins: Twins = of_kind(kind)
    spots = [twins.spots[0], twins.empty_spots[0]]
    eye = np.array([spots[0][0], 0.0, 1.4])
    T = looking(eye, spots[0], UP)
    first, second = (render(twins.scene, S @ T, SMALL) for S in (np.eye(4), T_SECOND_FIRST))
    assert first.rgb is not None and second.rgb is not None
    grey = np.abs(first.rgb.astype(float) - second.rgb.astype(float)).max(axis=2)
    differs = np.abs(first.true_depth - second.true_depth) > 0.05 if kind == "chair" else grey > 40.0
    assert np.count_nonzero(differs) > 10
    T = looking(eye, np.array([eye[0], -spots[0][1], 1.0]), UP)
    first, second = (render(twins.scene, S @ T, SMALL, with_colour=False) for S in (np.eye(4), T_SECOND_FIRST))
    assert np.abs(first.true_depth - second.true_depth).max() < 0.02


def test_a_recording_goes_through_both_twice_and_is_the_same_for_a_seed() -> None:
    plan, again = (make_plan("twins", 1, frames=60) for _ in range(2))
    side = plan.T_world_camera[:, 0, 3] > 0.0
    assert not side[0] and np.count_nonzero(np.diff(side)) == 3
    assert np.array_equal(plan.T_world_camera, again.T_world_camera)
    assert np.array_equal(twins_of(1).scene.places[0].centre, plan.scenes[0].places[0].centre)
