# SPDX-License-Identifier: Apache-2.0
"""Two furnished places that are equal but for one thing: one poster, one book, or where one chair stands.

The second is the first one turned by half a circle about the origin, where both are open to each other. So whatever is
seen of the one from a pose is seen of the other from that pose turned, but for what differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_tools.simulation.world import furniture, print_design
from objreg_tools.simulation.world.furniture import Furniture
from objreg_tools.simulation.world.mesh import Material, Mesh, box
from objreg_tools.simulation.world.model import ObjectModel, turn
from objreg_tools.simulation.world.objects import make_object
from objreg_tools.simulation.world.rooms import (
    Laid,
    Spot,
    along_the_walls,
    on_the_boards,
    places_of,
    table_with,
    things,
)
from objreg_tools.simulation.world.scene import Scene, lamps_for, number, place_on

Random = np.random.Generator

HALF = (2.6, 3.0)
WALLS_M = 0.2
"""The two walls between the places are so thick together."""
MIDDLE_X = -(HALF[0] + WALLS_M / 2)
"""The middle of the first place."""
OPEN_TO = (270,)
"""The wall with the opening, as `furniture.room` has it."""
KINDS = ("poster", "book", "chair")
POSTER_M = (0.6, 0.8)
POSTER_BOTTOM_M = 1.05
CHAIR_M = 0.42
"""A chair stands so far to the one or the other side of the middle of the table."""
T_SECOND_FIRST = turn("z", 180.0)
"""Brings what is in the first place to where it is in the second."""


@dataclass(frozen=True, eq=False)
class Twins:
    """The ``scene`` of both places, whose places are their tables; ``front`` the azimuth in degrees, about the first
    table, of the line to the opening. They differ in one thing of this ``kind``: in the first place it is at
    ``spots[0] (3,)`` m, and in the second at ``spots[1]``.
    """

    scene: Scene
    kind: str
    front: float
    spots: Array

    @property
    def empty_spots(self) -> Array:
        """(2, 3) where the thing would be in either place if they were equal; that of the other place, brought over."""
        return transform(T_SECOND_FIRST, self.spots[::-1])


def make_twins(rng: Random, occluders: int = 0) -> Twins:
    """The places with all that is in them, and one of `KINDS` that differs; every table has so many more things."""
    kind = str(rng.choice(KINDS))
    side = float(rng.choice([-1, 1]))
    walls = furniture.room(rng, HALF, open_to=OPEN_TO)
    lamps, ambient = lamps_for(rng, walls, 1)
    T_here = turn("z", 0.0)
    T_here[0, 3] = MIDDLE_X
    table = furniture.table(rng, (float(rng.uniform(1.2, 1.5)), float(rng.uniform(0.7, 0.85))))
    T = turn("z", float(rng.normal(0, 12)))
    T[:2, 3] = [MIDDLE_X + rng.uniform(-0.25, 0.25), side * rng.uniform(0.75, 1.0)]
    pieces = [(piece, T_here @ P) for piece, P in along_the_walls(rng, _spots())]
    laid = table_with(rng, table, T, _things(rng), occluders) + on_the_boards(rng, pieces)
    chairs = _chairs(rng, table, T, side)
    posters = _posters(rng, side)
    first, second = [*laid, chairs[0]], _turned([*laid, chairs[int(kind == "chair")]])
    if kind == "book":
        second = _with_another_book(rng, second)
    hung = [posters[0], posters[int(kind == "poster")].placed(T_SECOND_FIRST)]
    rooms = [walls.mesh.placed(T_here), walls.mesh.placed(T_SECOND_FIRST @ T_here)]
    stands = [(piece, S @ P) for S in (np.eye(4), T_SECOND_FIRST) for piece, P in ((table, T), *pieces)]
    here = [replace(lamp, position=transform(T_here, lamp.position)) for lamp in lamps]
    scene = Scene(
        objects=number([*first, *second]),
        backdrop=(*rooms, *hung, *(piece.mesh.placed(P) for piece, P in stands)),
        lamps=(*here, *(replace(lamp, position=transform(T_SECOND_FIRST, lamp.position)) for lamp in here)),
        ambient=ambient,
        places=places_of([(table, T), (table, T_SECOND_FIRST @ T)]),
        ceiling=(walls.ceiling.placed(T_here), walls.ceiling.placed(T_SECOND_FIRST @ T_here)),
        reach=2 * HALF[0] + WALLS_M,
    )
    return Twins(scene, kind, -90.0 * side, np.array([_spot(kind, first, hung[0]), _spot(kind, second, hung[1])]))


def _spots() -> list[Spot]:
    """Two spots at each long wall, and one at the wall without an opening."""
    x, y = HALF
    return [(0, -1.3, y), (0, 1.3, y), (180, -1.3, y), (180, 1.3, y), (90, 0.0, x)]


def _things(rng: Random) -> list[ObjectModel]:
    """What lies on a table: a book first, which always finds a spot."""
    some = things(rng, int(rng.integers(5, 8)), int(rng.integers(1, 4)))
    return [make_object("book", int(rng.integers(2**31))), *(one for one in some if one.label != "book")]


def _chairs(rng: Random, table: Furniture, T: Array, side: float) -> Laid:
    """One chair behind the table, once to the left of its middle and once to the right."""
    model, half_y = make_object("chair", int(rng.integers(2**31))), table.boards[0][4]
    yaw = (0.0 if side > 0 else np.pi) + float(rng.normal(0, 0.25))
    out, sign = side * (half_y + float(rng.uniform(0.2, 0.35))), float(rng.choice([-1, 1]))
    return [(model, T @ place_on(model, np.eye(4), s * sign * CHAIR_M, out, yaw)) for s in (1, -1)]


def _posters(rng: Random, side: float) -> list[Mesh]:
    """Two posters on the same spot of the wall behind the table."""
    width, tall = POSTER_M
    T = turn("z", 0.0 if side > 0 else 180.0)
    T[:3, 3] = [MIDDLE_X, side * HALF[1], 0.0]
    prints = [Material(print_design.poster(rng), specular=0.1) for _ in range(2)]
    return [box((width, 0.03, tall), one).moved(0.0, -0.015, POSTER_BOTTOM_M).placed(T) for one in prints]


def _turned(laid: Sequence[tuple[ObjectModel, Array]]) -> Laid:
    return [(model, T_SECOND_FIRST @ T) for model, T in laid]


def _with_another_book(rng: Random, laid: Laid) -> Laid:
    """The first book of all is another one."""
    k = _first(laid, "book")
    return [*laid[:k], (make_object("book", int(rng.integers(2**31))), laid[k][1]), *laid[k + 1 :]]


def _first(laid: Sequence[tuple[ObjectModel, Array]], label: str) -> int:
    return next(k for k, (model, _) in enumerate(laid) if model.label == label)


def _spot(kind: str, laid: Sequence[tuple[ObjectModel, Array]], poster: Mesh) -> Array:
    """The middle (3,) of what differs, in one of the places."""
    if kind == "poster":
        return np.asarray(poster.bounds.mean(axis=0))
    last = len(laid) - 1  # the chair comes last of all
    model, T = laid[last if kind == "chair" else _first(laid, kind)]
    return np.asarray(transform(T, model.mesh.vertices.astype(float).mean(axis=0)))
