# SPDX-License-Identifier: Apache-2.0
"""Simulated looks at one object or at four, with the camera's true pose."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
from paper import UP, Stage, keyframe

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.geometry import pose
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.prepare.prepared import Prepared, prepare
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_tools.simulation.params import StressParams
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.world import furniture
from objreg_tools.simulation.world.objects import make_object
from objreg_tools.simulation.world.scene import furnished, number, place_on

Look = tuple[str, int]  # the kind of object, and the room
FOUR = ("cereal_box", "book", "keyboard", "bowl", "cap", "flashlight", "soda_can")


@dataclass(frozen=True)
class Setting:
    """What every look of a condition shares: its stress, the seed of the hands, and the registrar's parameters."""

    stress: StressParams
    seed: int
    params: RegistrarParams


@dataclass(frozen=True, eq=False)
class Shot:
    """One look: the camera's true pose and what the segmenter made of it."""

    T_world_camera: Array
    frame: Frame
    key: Keyframe
    _made: list[Prepared] = field(default_factory=list)

    def prepared(self, params: RegistrarParams) -> Prepared:
        """The keyframe made ready, with the grids that others are laid upon."""
        if not self._made:
            self._made.append(prepare(self.key, params))
            for shape in (*self._made[0].shapes, self._made[0].scene):
                assert shape is None or len(shape.surface) >= 0
        return self._made[0]


def look(stage: Stage, T_world_camera: Array, seed: int, setting: Setting) -> Shot:
    """A picture of a stage with the true boxes of its objects."""
    image = render(stage.scene, T_world_camera, seed=seed, stress=setting.stress)
    seen = [item for item in image.objects if item.visibility > 0.3]
    detections = Detections(
        xyxy=np.array([item.xyxy for item in seen], np.float32).reshape(-1, 4),
        score=np.ones(len(seen), np.float32),
        label=tuple(item.label for item in seen),
        image_hw=image.depth.shape,
        stamp_ns=seed,
    )
    depth = DepthImage(depth=image.depth, rgb=image.rgb, intrinsics=image.intrinsics, stamp_ns=seed)
    frame = Segmenter(SegmenterParams()).segment(detections, depth)
    return Shot(T_world_camera, frame, keyframe(frame, setting.params))


def four(seed: int) -> Stage:
    """A table with four different objects; its middle is the object of the stage."""
    rng = np.random.default_rng([seed, 4])
    labels = rng.permutation(FOUR)[:4]
    table, room = furniture.table(rng, (1.3, 0.9)), furniture.room(rng, (3.2, 2.5))
    height = table.boards[0][2]
    corners = np.array([(-0.3, -0.2), (0.3, -0.2), (-0.3, 0.2), (0.3, 0.2)]) + rng.uniform(-0.05, 0.05, (4, 2))
    models = [make_object(str(label), int(rng.integers(2**31))) for label in labels]
    T_table = pose(np.eye(3), np.array([0.0, 0.0, height]))
    placed = [
        (model, place_on(model, T_table, x, y, float(rng.uniform(0, 2 * np.pi))))
        for model, (x, y) in zip(models, corners, strict=True)
    ]
    scene = furnished(rng, [(table, np.eye(4))], room).with_objects(number(placed))
    return Stage(scene, models[0], pose(np.eye(3), np.array([0.0, 0.0, height])), float(rng.uniform(0, 360)), 1.15)


def around(stage: Stage, angle: float, rng: np.random.Generator) -> Array:
    """``T_world_camera`` after going around a table by ``angle`` degrees; distance and aim differ a little."""
    azimuth, elevation = np.radians(stage.start_deg + angle), np.radians(38.0)
    away = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    centre = stage.T_world_object[:3, 3]
    aim = centre + rng.normal(0.0, 0.03, 3)
    return looking(centre + stage.distance * rng.uniform(0.9, 1.1) * away, aim, UP)


class Shots:
    """The looks at one stage: another hand holds the camera for each of them, the same whenever it is asked for."""

    def __init__(
        self, setting: Setting, stage: Stage, camera: Callable[[float, np.random.Generator], Array], name: list[Any]
    ) -> None:
        self._setting, self._stage, self._camera = setting, stage, camera
        self._name = zlib.crc32(repr(name).encode())
        self._kept: dict[float, Shot] = {}

    def next(self, angle: float) -> Shot:
        """A second look from an angle."""
        return self._look(angle, 2)

    def first(self, angle: float) -> Shot:
        """The first look from an angle; it is kept."""
        if angle not in self._kept:
            self._kept[angle] = self._look(angle, 1)
        return self._kept[angle]

    def _look(self, angle: float, time: int) -> Shot:
        hand = np.random.default_rng([self._setting.seed, self._name, round(angle), time])
        T = self._camera(angle, hand)
        return look(self._stage, T, int(hand.integers(2**31)), self._setting)


def strangers(looks: Sequence[Look], count: int, rng: np.random.Generator) -> list[tuple[Look, Look]]:
    """Up to ``count`` different pairs of looks at different rooms, half of them at the same kind where there are."""
    pairs = [(a, b) for a, b in combinations(looks, 2) if a[1] != b[1]]
    mixed = [pairs[k] for k in rng.permutation(len(pairs))]
    alike, other = ([pair for pair in mixed if (pair[0][0] == pair[1][0]) is same] for same in (True, False))
    half = max(count // 2, count - len(other))
    return (alike[:half] + other)[:count]
