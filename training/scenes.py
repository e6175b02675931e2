# SPDX-License-Identifier: Apache-2.0
"""Scenes to learn from: the simulator's rooms and scenarios, desks as people keep them, and wild ones where only shape
can be trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.simulation.rendering.light import Lamp, looking
from objreg_tools.simulation.scenarios import OF_ONE_DAY, make_plan
from objreg_tools.simulation.world import furniture, texture
from objreg_tools.simulation.world.distractors import make_distractor
from objreg_tools.simulation.world.mesh import Material, Mesh, box
from objreg_tools.simulation.world.model import ObjectModel, turn
from objreg_tools.simulation.world.objects import LABELS, make_object
from objreg_tools.simulation.world.scene import (
    Place,
    Placed,
    Scene,
    number,
    place_on,
    random_scene,
    random_view,
    some_models,
    spread,
)

Rng = np.random.Generator
Laid = list[tuple[ObjectModel, Array]]


PLAN_FRAMES = 120
"""A recording of so few frames costs little and passes every place."""


HARD_LABELS = (
    *LABELS * 2, *("flashlight", "book") * 12, *("cereal_box", "soda_can") * 4, *("bowl",) * 3, *("keyboard",) * 2
)  # fmt: skip
"""The labels of a scene that is full of flashlights, of books, and of what is taken for them."""

LOOK_ALIKES, LOOK_ALIKE_SHARE = ("stick", "stick", "stick", "papers", "carton", "bottle", "vase"), 0.6


def training_scene(rng: Rng) -> tuple[Scene, Array]:
    """A scene of a random kind under random light, and camera poses ``(N, 4, 4)`` that belong to it, N maybe 0."""
    kind = rng.random()
    poses = np.zeros((0, 4, 4))
    if kind < 0.4:
        scene = random_scene(_seed(rng), distractor_share=rng.uniform(0.1, 0.6))
    elif kind < 0.65:
        plan = make_plan(str(rng.choice(list(OF_ONE_DAY))), _seed(rng), PLAN_FRAMES, occluders=int(rng.integers(3)))
        scene, poses = plan.scenes[0], plan.T_world_camera[plan.scene_of == 0]
    elif kind < 0.8:
        scene = desk(rng)
    else:
        scene = wild(rng)
    return (relit(scene, rng) if rng.random() < 0.5 else scene), poses


def plain_scene(rng: Rng) -> tuple[Scene, Array]:
    """A room or a scenario just as the simulator makes it, and the camera poses of the scenario ``(N, 4, 4)``."""
    if rng.random() < 0.5:
        return random_scene(_seed(rng)), np.zeros((0, 4, 4))
    return _of_scenario(rng)


def hard_scene(rng: Rng) -> tuple[Scene, Array]:
    """The same, but the rooms, three of four, are full of what is hardest to distinguish, and of its look-alikes."""
    if rng.random() < 0.75:
        scene, poses = random_scene(_seed(rng), HARD_LABELS, rng.uniform(0.25, 0.55)), np.zeros((0, 4, 4))
    else:
        scene, poses = _of_scenario(rng)
    return (with_look_alikes(scene, rng) if rng.random() < 0.5 else scene), poses


def with_look_alikes(scene: Scene, rng: Rng) -> Scene:
    """The scene with most of the distractors that stand in it replaced by what is taken for flashlights and books."""

    def other(placed: Placed) -> Placed:
        stands = placed.T_world_object[2, 2] > 0.99
        if not (placed.is_distractor and stands and rng.random() < LOOK_ALIKE_SHARE):
            return placed
        return replace(placed, model=make_distractor(str(rng.choice(LOOK_ALIKES)), _seed(rng)))

    return scene.with_objects([other(placed) for placed in scene.objects])


def _of_scenario(rng: Rng) -> tuple[Scene, Array]:
    """One of the scenes of a scenario and the camera poses in it."""
    plan = make_plan(str(rng.choice(list(OF_ONE_DAY))), _seed(rng), PLAN_FRAMES)
    chosen = int(rng.integers(len(plan.scenes)))
    return plan.scenes[chosen], plan.T_world_camera[plan.scene_of == chosen]


def desk(rng: Rng) -> Scene:
    """A table against a wall with a monitor, a keyboard before it, a mouse, books, a chair, and more."""
    room = furniture.room(rng, (rng.uniform(1.3, 2.5), rng.uniform(1.3, 2.5)))
    table = furniture.table(rng, (rng.uniform(1.1, 1.8), rng.uniform(0.65, 0.9)))
    T_table = pose(np.eye(3), np.array([rng.uniform(-0.3, 0.3), room.half[1] - 0.5, 0.0]))
    board = table.boards[0]
    surface = T_table @ pose(np.eye(3), np.array([board[0], board[1], board[2]]))
    x = rng.uniform(-0.3, 0.3)
    laid: Laid = [
        (make_object("monitor", _seed(rng)), place_on_yawed(surface, rng, x, rng.uniform(0.05, 0.25))),
        (make_object("keyboard", _seed(rng)), place_on_yawed(surface, rng, x + rng.normal(0, 0.05), -0.15)),
        (make_distractor("mouse", _seed(rng)), place_on_yawed(surface, rng, x + 0.3, -0.15)),
    ]
    free = (board[0] + (-0.45 if x > 0 else 0.45), board[1], board[2], 0.22, board[4])
    beside = some_models(rng, int(rng.integers(2, 8)), 0.3)
    laid += [(model, T_table @ T) for model, T in spread(rng, beside, free)]
    chair = make_object("chair", _seed(rng))
    laid.append((chair, place_on(chair, T_table, x, -rng.uniform(0.55, 0.9), np.pi + rng.normal(0, 0.5))))
    scene = Scene(number(laid), (room.mesh, table.mesh.placed(T_table)), *_light(rng), ceiling=(room.ceiling,))
    centre = surface[:3, 3] + [0, 0, 0.1]
    return replace(scene, places=(Place(centre, 0.6),), middle=centre, reach=2.0)


def place_on_yawed(surface: Array, rng: Rng, x: float, y: float) -> Array:
    """A pose on a surface near (x, y), nearly square to it."""
    return surface @ pose(np.eye(3), np.array([x, y, 0.0])) @ turn("z", float(rng.normal(0, 8)))


def wild(rng: Rng) -> Scene:
    """Objects laid or hung at random before surfaces of any texture."""
    table = (rng.uniform(0.6, 2.0), rng.uniform(0.6, 2.0), 0.05)
    height, far = rng.uniform(0.3, 0.9), rng.uniform(1.0, 2.5)
    backdrop = [
        _any(rng, (8, 8, 0.1)).moved(z=-0.1),
        _any(rng, table).moved(z=height - 0.05),
        _any(rng, (8, 0.1, 4)).moved(y=far),
        _any(rng, (0.1, 8, 4)).moved(x=float(rng.choice([-1, 1])) * rng.uniform(1.2, 2.5)),
    ]
    board = (0.0, 0.0, height, table[0] / 2, table[1] / 2)
    laid = spread(rng, some_models(rng, int(rng.integers(5, 18)), rng.uniform(0.1, 0.5)), board)
    if rng.random() < 0.3:
        laid = [(model, _tumbled(rng, T)) for model, T in laid]
    for _ in range(int(rng.integers(0, 3))):
        chair = make_object("chair", _seed(rng))
        x, y = rng.uniform(-1.2, 1.2, 2)
        laid.append((chair, place_on(chair, np.eye(4), x, y - 0.5, rng.uniform(0, 2 * np.pi))))
    middle = np.array([0, 0, height + 0.1])
    place = Place(middle, max(table[:2]) / 2)
    return Scene(number(laid), tuple(backdrop), *_light(rng), places=(place,), middle=middle, reach=2.0)


def relit(scene: Scene, rng: Rng) -> Scene:
    """The same scene under other lamps."""
    lamps, ambient = _light(rng)
    return replace(scene, lamps=lamps, ambient=ambient)


def _light(rng: Rng) -> tuple[tuple[Lamp, ...], Array]:
    """One to four lamps anywhere above, coloured, and what comes from everywhere."""
    tone = np.exp(rng.normal(0, 0.15, 3))
    lamps = []
    for _ in range(int(rng.integers(1, 5))):
        at = np.array([*rng.uniform(-2.5, 2.5, 2), rng.uniform(1.6, 2.6)])
        lamps.append(Lamp(at, tone * rng.uniform(0.1, 1.2) * np.exp(rng.normal(0, 0.15, 3))))
    return tuple(lamps), tone * rng.uniform(0.08, 0.7)


def _any(rng: Rng, size: tuple[float, float, float]) -> Mesh:
    picture = texture.any_surface(rng) if rng.random() < 0.6 else texture.patches(rng)
    return box(size, Material(picture, specular=rng.uniform(0, 0.3)), tile=float(np.exp(rng.uniform(-1.5, 1.0))))


def _tumbled(rng: Rng, T: Array) -> Array:
    """The pose turned at random about the object's place, a little higher."""
    R = rotation_from_vector(rng.normal(0, 1.2, 3))
    return pose(R @ T[:3, :3], T[:3, 3] + [0, 0, rng.uniform(0.05, 0.4)])


def training_view(scene: Scene, poses: Array, rng: Rng, focal_px: float, width_px: int) -> Array:
    """``T_world_camera``: one of ``poses``, or a view of one of the objects at a size from tiny to overwhelming."""
    if len(poses) and rng.random() < 0.6:
        return poses[int(rng.integers(len(poses)))]
    wanted = [placed for placed in scene.objects if not placed.is_distractor]
    if not wanted or rng.random() < 0.3:
        return random_view(scene, _seed(rng))
    return _aimed(rng, _any_of(rng, wanted), focal_px, width_px)


def _any_of(rng: Rng, objects: Sequence[Placed]) -> Placed:
    """One of the objects, rare labels as often as common ones."""
    labels = sorted({placed.label for placed in objects}, key=LABELS.index)
    label = labels[int(rng.integers(len(labels)))]
    same = [placed for placed in objects if placed.label == label]
    return same[int(rng.integers(len(same)))]


def _aimed(rng: Rng, placed: Placed, focal_px: float, width_px: int) -> Array:
    size = float(np.linalg.norm(placed.model.size))
    share = np.exp(rng.uniform(np.log(0.06), np.log(0.9)))
    distance = float(np.clip(focal_px * size / (share * width_px), 0.4, 4.5))
    T = placed.T_world_object
    centre = T[:3, :3] @ placed.model.mesh.bounds.mean(axis=0) + T[:3, 3]
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.radians(rng.triangular(2, 30, 80))
    away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    beside = rng.uniform(-1, 1, 3) * distance * 0.45 * width_px / focal_px * np.array([1, 1, 0.6])
    eye = centre + distance * away
    eye[2] = np.clip(eye[2], 0.15, 2.4)
    return looking(eye, centre + beside * rng.random(), np.array([0.0, 0.0, 1.0])) @ turn("z", float(rng.normal(0, 6)))


def _seed(rng: Rng) -> int:
    return int(rng.integers(2**31))
