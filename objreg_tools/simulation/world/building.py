# SPDX-License-Identifier: Apache-2.0
"""Three furnished rooms in a row: one walks from each to the next through an opening, and each has a table of its own.

The row lies along x, the middle room about the origin. The openings are on the line y = 0; it is kept clear, and every
table stands to one side of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose
from objreg_tools.simulation.rendering.light import Lamp
from objreg_tools.simulation.world import furniture
from objreg_tools.simulation.world.furniture import Furniture, Room
from objreg_tools.simulation.world.model import turn
from objreg_tools.simulation.world.rooms import (
    Laid,
    Spot,
    along_the_walls,
    chairs_at,
    on_the_boards,
    places_of,
    table_with,
    things,
)
from objreg_tools.simulation.world.scene import Scene, lamps_for, number

Random = np.random.Generator

ROOM_HALF = (2.6, 3.0)
WALLS_M = 0.2
"""The two walls between a room and the next are so thick together."""
ROOMS_X = tuple(k * (2 * ROOM_HALF[0] + WALLS_M) for k in (-1, 0, 1))
"""The middles of the rooms."""
OPENINGS_X = tuple((a + b) / 2 for a, b in pairwise(ROOMS_X))
OPEN_TO = ((270,), (90, 270), (90,))
"""The walls of each room with an opening, as `furniture.room` has them."""
LEFT, RIGHT = 90, 270
REACH_M = ROOMS_X[-1] + ROOM_HALF[0]


@dataclass(frozen=True, eq=False)
class Building:
    """The ``scene`` of all rooms, whose places are their tables in order; ``fronts`` the azimuths in degrees, about
    each table, of the line from opening to opening."""

    scene: Scene
    fronts: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class _Furnished:
    """A room where it stands in the building: what it is made of, its table, what lies about, and its lamp."""

    room: Room
    table: tuple[Furniture, Array]
    pieces: list[tuple[Furniture, Array]]
    laid: Laid
    lamps: tuple[Lamp, ...]
    front: float


def make_building(rng: Random, occluders: int) -> Building:
    """The rooms with all that is in them; ``occluders`` are things added to every table."""
    rooms = [_furnished(rng, x, open_to, occluders) for x, open_to in zip(ROOMS_X, OPEN_TO, strict=True)]
    _, ambient = lamps_for(rng, rooms[0].room, 0)
    pieces = [piece.mesh.placed(T) for r in rooms for piece, T in (r.table, *r.pieces)]
    scene = Scene(
        objects=number([item for r in rooms for item in r.laid]),
        backdrop=(*(r.room.mesh for r in rooms), *pieces),
        lamps=tuple(lamp for r in rooms for lamp in r.lamps),
        ambient=ambient,
        places=places_of([r.table for r in rooms]),
        ceiling=tuple(r.room.ceiling for r in rooms),
        reach=REACH_M,
    )
    return Building(scene, tuple(r.front for r in rooms))


def _furnished(rng: Random, x: float, open_to: tuple[int, ...], occluders: int) -> _Furnished:
    room = furniture.room(rng, ROOM_HALF, open_to=open_to)
    lamps, _ = lamps_for(rng, room, 1)
    side = float(rng.choice([-1, 1]))
    table = furniture.table(rng, (float(rng.uniform(1.2, 1.5)), float(rng.uniform(0.7, 0.85))))
    T = turn("z", float(rng.normal(0, 12)))
    T[:2, 3] = [x + rng.uniform(-0.25, 0.25), side * rng.uniform(0.75, 1.0)]
    walls = [(piece, _along(x) @ P) for piece, P in along_the_walls(rng, _spots(open_to))]
    laid = table_with(rng, table, T, things(rng, int(rng.integers(5, 8)), int(rng.integers(1, 4))), occluders)
    laid += chairs_at(rng, table, T, 1) + on_the_boards(rng, walls)
    here = replace(room, mesh=room.mesh.moved(x=x), ceiling=room.ceiling.moved(x=x))
    lamps = tuple(replace(lamp, position=lamp.position + np.array([x, 0.0, 0.0])) for lamp in lamps)
    return _Furnished(here, (table, T), walls, laid, lamps, -90.0 * side)


def _along(x: float) -> Array:
    """The pose of a room's own frame in the building."""
    return pose(np.eye(3), np.array([x, 0.0, 0.0]))


def _spots(open_to: tuple[int, ...]) -> list[Spot]:
    """Two spots at each long wall, and one at a wall without an opening."""
    x, y = ROOM_HALF
    closed = [(degrees, 0.0, x) for degrees in (LEFT, RIGHT) if degrees not in open_to]
    return [(0, -1.2, y), (0, 1.2, y), (180, -1.2, y), (180, 1.2, y), *closed]
