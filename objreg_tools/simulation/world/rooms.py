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
from objreg_tools.simulation.world.scene import Place, footprint, place_on, spread

Random = np.random.Generator
Laid = list[tuple[ObjectModel, Array]]
"""Models with their poses in the world."""
Spot = tuple[float, float, float]
"""A spot at a wall: degrees by which the wall is turned from that at +y, metres along it, metres out to it."""

TABLE_CLASSES = ("cereal_box", "soda_can", "bowl", "book", "cap", "flashlight", "keyboard", "monitor")
OCCLUDERS = ("mug", "bottle", "carton", "vase", "tin", "plant", "ball")
MOVED_M = 0.4  # what was moved stands at least so far from where it stood
GAP_M = 0.02
SAME_BOARD_M = 0.3  # what stands higher or lower than this is on another board


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
        laid.append((model, T @ _at_the_side(rng, model, half_y, int(side))))
    return laid


def _at_the_side(rng: Random, chair: ObjectModel, half_y: float, side: int) -> Array:
    """``T_table_chair`` of a chair at a long side of a table, turned to it."""
    yaw = (0.0 if side > 0 else np.pi) + rng.normal(0, 0.25)
    return place_on(chair, np.eye(4), rng.uniform(-0.35, 0.35), side * (half_y + rng.uniform(0.2, 0.4)), yaw)


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


def moved_about(
    rng: Random, laid: Laid, boards: Sequence[tuple[Furniture, Array]], tables: Sequence[tuple[Furniture, Array]]
) -> Laid:
    """What is ``laid``, a third of it elsewhere: on any of the ``boards``, chairs at the ``tables``.

    It stands `MOVED_M` or more from where it stood. What finds no spot after some trials is taken away.
    """
    now: list[tuple[ObjectModel, Array] | None] = list(laid)
    for k in rng.permutation(len(laid))[: round(len(laid) / 3)]:
        (model, before), now[k] = laid[k], None
        others = [item for item in now if item is not None]
        spots = (_some_spot(rng, model, tables if model.label == "chair" else boards) for _ in range(200))
        free = (T for T in spots if T is not None and _is_free(model, T, before, others))
        T = next(free, None)
        now[k] = None if T is None else (model, T)
    return [item for item in now if item is not None]


def _some_spot(rng: Random, model: ObjectModel, pieces: Sequence[tuple[Furniture, Array]]) -> Array | None:
    """A pose in the world at random, on a board of a piece or, of a chair, beside it; None if it does not fit there."""
    piece, T = pieces[int(rng.integers(len(pieces)))]
    if model.label == "chair":
        return T @ _at_the_side(rng, model, piece.boards[0][4], int(rng.choice([-1, 1])))
    x, y, height, half_x, half_y = piece.boards[int(rng.integers(min(4, len(piece.boards))))]
    _, radius = footprint(model, np.eye(4))
    if radius > 1.3 * max(half_x, half_y) or model.size[2] > piece.clearance:
        return None
    at_x, at_y = (c + rng.uniform(-1, 1) * max(half - 0.7 * radius, 0.0) for c, half in ((x, half_x), (y, half_y)))
    board = np.eye(4)
    board[2, 3] = height
    return T @ place_on(model, board, at_x, at_y, float(rng.uniform(0, 2 * np.pi)))


def _is_free(model: ObjectModel, T: Array, before: Array, others: Laid) -> bool:
    """Whether a thing may stand at a pose: far from where it was ``before``, and apart from the ``others``."""
    if np.linalg.norm(T[:3, 3] - before[:3, 3]) < MOVED_M:
        return False
    middle, radius = footprint(model, T)
    for other, P in others:
        at, reach = footprint(other, P)
        is_beside = abs(T[2, 3] - P[2, 3]) < SAME_BOARD_M
        if is_beside and np.linalg.norm(middle - at) < radius + reach + GAP_M:
            return False
    return True
