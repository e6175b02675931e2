# SPDX-License-Identifier: Apache-2.0
"""The contents of the rooms of recordings: things on tables and boards, chairs, and furniture along the walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_tools.simulation.world import distractors, furniture
from objreg_tools.simulation.world.furniture import Furniture
from objreg_tools.simulation.world.model import ObjectModel, turn
from objreg_tools.simulation.world.objects import make_object
from objreg_tools.simulation.world.scene import Place, place_on, spread

Random = np.random.Generator
Laid = list[tuple[ObjectModel, Array]]
"""Models with their poses in the world."""
Spot = tuple[float, float, float]
"""A spot at a wall: degrees by which the wall is turned from that at +y, metres along it, metres out to it."""

TABLE_CLASSES = ("cereal_box", "soda_can", "bowl", "book", "cap", "flashlight", "keyboard", "monitor")
OCCLUDERS = ("mug", "bottle", "carton", "vase", "tin", "plant", "ball")


def table_with(rng: Random, piece: Furniture, T: Array, models: list[ObjectModel], occluders: int) -> Laid:
    """Models at random on a table, and small things close beside them."""
    kinds = rng.choice(OCCLUDERS, occluders)
    more = [distractors.make_distractor(str(kind), int(rng.integers(2**31))) for kind in kinds]
    return [(model, T @ P) for model, P in spread(rng, [*models, *more], piece.boards[0], 0.02, beside=occluders)]


def things(rng: Random, count: int, extra: int) -> list[ObjectModel]:
    """``count`` objects of different classes where possible, and ``extra`` distractors; the large ones first."""
    labels = [*rng.permutation(TABLE_CLASSES), *rng.choice(TABLE_CLASSES, max(0, count - len(TABLE_CLASSES)))][:count]
    models = [make_object(str(label), int(rng.integers(2**31))) for label in labels]
    kinds = rng.choice(list(distractors.FAMILIES), extra)
    models += [distractors.make_distractor(str(kind), int(rng.integers(2**31))) for kind in kinds]
    return sorted(models, key=lambda model: -model.radius)


def chairs_at(rng: Random, piece: Furniture, T: Array, count: int) -> Laid:
    """Chairs at the long sides of a table, turned to it."""
    _, half_y = piece.boards[0][3:]
    laid: Laid = []
    for side in rng.permutation([-1, 1])[:count]:
        model = make_object("chair", int(rng.integers(2**31)))
        yaw = (0.0 if side > 0 else np.pi) + rng.normal(0, 0.25)
        local = place_on(model, np.eye(4), rng.uniform(-0.35, 0.35), side * (half_y + rng.uniform(0.2, 0.4)), yaw)
        laid.append((model, T @ local))
    return laid


def on_the_boards(rng: Random, pieces: Sequence[tuple[Furniture, Array]]) -> Laid:
    """Two or three things on each of the lower boards of every piece."""
    laid: Laid = []
    for piece, T in pieces:
        for board in piece.boards[:4]:
            few = things(rng, 2, 1)
            laid += [(m, T @ P) for m, P in spread(rng, few, board, clearance=piece.clearance)]
    return laid


def along_the_walls(rng: Random, spots: Sequence[Spot]) -> list[tuple[Furniture, Array]]:
    """Shelves, cupboards and sofas against the walls at most of the spots, their backs to the wall."""
    kinds = (furniture.shelf, furniture.cupboard, furniture.sofa)
    out = []
    for degrees, along, reach in spots:
        if rng.random() < 0.25:
            continue
        piece = kinds[int(rng.choice(3, p=[0.5, 0.35, 0.15]))](rng)
        T = turn("z", degrees)
        T[:3, 3] = T[:3, :3] @ [along, reach - float(piece.mesh.bounds[1, 1]) - 0.02, 0.0]
        out.append((piece, T))
    return out


def places_of(tables: Sequence[tuple[Furniture, Array]]) -> tuple[Place, ...]:
    """The places just above the tops of tables."""
    return tuple(Place(transform(T, np.array([0, 0, p.boards[0][2] + 0.08])), p.boards[0][3]) for p, T in tables)
