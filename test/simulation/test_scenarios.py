# SPDX-License-Identifier: Apache-2.0
"""Recording plans: what each scenario promises."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import rotation_angle
from objreg_tools.simulation import scenarios
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.scenarios import SCENARIOS, RecordingPlan
from objreg_tools.simulation.world.scene import Scene

from .motions import speeds

make_plan = cache(scenarios.make_plan)  # making a room takes half a second
SMALL = Intrinsics(fx=131.25, fy=131.25, cx=79.5, cy=59.5, width=160, height=120)


def seen_on_the_first_table(plan: RecordingPlan, k: int) -> set[int]:
    """Instances that frame ``k`` shows and that stand at the first place of the plan."""
    scene = plan.scenes[plan.scene_of[k]]
    place = scene.places[0]
    seen = render(scene, plan.T_world_camera[k], SMALL, with_colour=False).seen
    return {
        o.instance
        for o in seen
        if np.linalg.norm(o.T_world_object[:2, 3] - place.centre[:2]) < place.reach
        and abs(o.T_world_object[2, 3] - place.centre[2]) < 0.2
    }


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_plan_moves_at_the_speed_of_a_hand(scenario: str) -> None:
    plan = make_plan(scenario, 0, frames=60)
    moved, turned = speeds(plan.T_world_camera, plan.rate)
    assert moved.max() < 0.55 and turned.max() < 45.0


@pytest.mark.parametrize("scenario", ["loop", "opposite", "look-alikes", "moved", "posters"])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_first_table_is_left_out_of_sight_and_seen_again(scenario: str, seed: int) -> None:
    plan = make_plan(scenario, seed, frames=60)
    counts = [len(seen_on_the_first_table(plan, 0) & seen_on_the_first_table(plan, k)) for k in range(0, 60, 2)]
    away = counts.index(0)
    assert counts[0] >= 3 and max(counts[away:]) >= 3


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_opposite_returns_from_the_other_side_only_and_loop_from_nearby(seed: int) -> None:
    for scenario, low, high in (("opposite", 110.0, 180.0), ("loop", 0.0, 50.0)):
        plan = make_plan(scenario, seed, frames=120)
        assert low < nearest_return_deg(plan) < high


def nearest_return_deg(plan: RecordingPlan) -> float:
    """How much else, in degrees, the first table is looked at when it is in the middle of the picture again."""
    T = plan.T_world_camera
    to_table = plan.scenes[0].places[0].centre - T[:, :3, 3]
    distance = np.linalg.norm(to_table, axis=1)
    looks = np.flatnonzero((np.einsum("ij,ij->i", T[:, :3, 2], to_table) > 0.95 * distance) & (distance < 1.6))
    first_left = int(np.flatnonzero(np.diff(looks) > 5)[0])
    visit, later = looks[: first_left + 1], looks[first_left + 1 :]
    return min(float(np.degrees(rotation_angle(T[a, :3, :3].T @ T[b, :3, :3]))) for a in visit for b in later)


def test_look_alikes_have_the_same_classes_on_both_tables_in_different_places() -> None:
    scene = make_plan("look-alikes", 0, frames=60).scenes[0]
    labels = []
    for place in scene.places:
        near = [o for o in scene.objects if np.linalg.norm(o.T_world_object[:3, 3] - place.centre) < place.reach]
        labels.append({o.label for o in near if not o.is_distractor and o.label != "chair"})
    assert len(labels[0] & labels[1]) >= 3


def test_moved_rearranges_the_first_table_only_and_while_it_is_out_of_sight() -> None:
    plan = make_plan("moved", 1, frames=60)
    before, after = ({o.instance: o for o in scene.objects} for scene in plan.scenes)
    shifted = {
        k for k in before.keys() & after.keys() if not np.array_equal(before[k].T_world_object, after[k].T_world_object)
    }
    change = int(np.argmax(plan.scene_of))
    assert len(shifted) >= 3 and before[min(shifted)].model is after[min(shifted)].model
    for k in (change - 1, change):
        scene = plan.scenes[plan.scene_of[k]]
        seen = render(scene, plan.T_world_camera[k], SMALL, with_colour=False).seen
        assert not shifted & {o.instance for o in seen}


def test_occluders_crowd_the_tables() -> None:
    plain, crowded = (
        plan.scenes[0] for plan in (make_plan("loop", 0, frames=60), make_plan("loop", 0, frames=60, occluders=8))
    )
    assert crowd(crowded) > crowd(plain) + 3


def crowd(scene: Scene) -> int:
    """How many things stand on the two tables."""
    on = [p.centre for p in scene.places]
    return sum(min(float(np.linalg.norm(o.T_world_object[:3, 3] - c)) for c in on) < 0.8 for o in scene.objects)


def test_an_unknown_scenario_is_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="expected one of orbit, loop"):
        make_plan("maze", 0)


def test_a_third_of_the_things_stand_elsewhere_on_the_second_of_two_days() -> None:
    plan = make_plan("days", 0, frames=60)
    before, after = ({o.instance: o for o in scene.objects} for scene in plan.scenes)
    assert set(after) <= set(before) and plan.scene_of.tolist() == [0] * 30 + [1] * 30
    apart = [float(np.linalg.norm(after[k].T_world_object[:3, 3] - before[k].T_world_object[:3, 3])) for k in after]
    elsewhere = [metres for metres in apart if metres > 0.0]
    assert len(elsewhere) + len(before) - len(after) == round(len(before) / 3) and min(elsewhere) >= 0.4


def test_training_draws_from_scenarios_of_one_day() -> None:
    assert set(SCENARIOS) - set(scenarios.OF_ONE_DAY) == {"days", "twins"}
