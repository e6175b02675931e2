# SPDX-License-Identifier: Apache-2.0
"""A scene: placed objects in a furnished room under lamps; and rooms made at random from a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, transform
from objreg_tools.simulation.rendering.light import Lamp, ShadowMaps, looking, shadow_maps
from objreg_tools.simulation.rendering.raster import rasterise
from objreg_tools.simulation.rendering.surfaces import Surfaces, flatten
from objreg_tools.simulation.world import distractors, furniture
from objreg_tools.simulation.world.furniture import Furniture, Room
from objreg_tools.simulation.world.mesh import Mesh
from objreg_tools.simulation.world.model import ObjectModel, turn
from objreg_tools.simulation.world.objects import LABELS, make_object

Random = np.random.Generator
Board = tuple[float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Placed:
    """An object in the world: ``instance`` from 1 is its number in masks; ``T_world_object (4, 4)``."""

    instance: int
    model: ObjectModel
    T_world_object: Array

    @property
    def label(self) -> str:
        """The class of the object, or the kind of the distractor."""
        return self.model.label

    @property
    def is_distractor(self) -> bool:
        """Whether the object is none of the nine classes."""
        return self.model.label not in LABELS


@dataclass(frozen=True, eq=False)
class Place:
    """Where objects stand: ``centre (3,)`` m in the world, among them, and their ``reach`` around it."""

    centre: Array
    reach: float


@dataclass(frozen=True, eq=False)
class Scene:
    """``objects`` in front of a ``backdrop`` under ``lamps``; ``ambient (3,)`` linear light from everywhere.

    ``ceiling`` is what throws no shadow; ``places`` are where the objects stand; shadows are soft within ``reach``
    metres of ``middle (3,)``.
    """

    objects: tuple[Placed, ...]
    backdrop: tuple[Mesh, ...]
    lamps: tuple[Lamp, ...]
    ambient: Array
    places: tuple[Place, ...] = ()
    ceiling: tuple[Mesh, ...] = ()
    reach: float = 3.0
    middle: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.75]))

    @cached_property
    def surfaces(self) -> Surfaces:
        """The scene's triangles: the room first, then every object in order."""
        rooms = [*self.backdrop, *self.ceiling]
        meshes = [*rooms, *(o.model.mesh.placed(o.T_world_object) for o in self.objects)]
        numbers = [0] * len(rooms) + [o.instance for o in self.objects]
        casts = [True] * len(self.backdrop) + [False] * len(self.ceiling) + [True] * len(self.objects)
        return flatten(meshes, numbers, casts)

    @cached_property
    def shadows(self) -> ShadowMaps:
        """The shadow maps of the lamps and of the open room above."""
        return shadow_maps(self.surfaces, self.lamps, self.middle, self.reach, size=1024 if self.reach > 2 else 512)

    @cached_property
    def face_range(self) -> dict[int, tuple[int, int]]:
        """First and last (outside) face of every instance."""
        instance = self.surfaces.instance
        first = {o.instance: int(np.argmax(instance == o.instance)) for o in self.objects}
        return {o.instance: (first[o.instance], first[o.instance] + len(o.model.mesh.faces)) for o in self.objects}

    def prepare(self) -> None:
        """Make everything that is the same in all images of the scene, so that several threads can share it."""
        _ = self.surfaces, self.shadows, self.face_range

    def with_objects(self, objects: Sequence[Placed]) -> Scene:
        """The same room with other objects in it."""
        return replace(self, objects=tuple(objects))


def place_on(model: ObjectModel, T_world_surface: Array, x: float, y: float, yaw: float, rest: int = 0) -> Array:
    """``T_world_object`` of a model at rest at (x, y) of a surface (z = 0), turned by ``yaw`` radians."""
    at = pose(np.eye(3), np.array([x, y, 0.0]))
    return T_world_surface @ at @ model.resting(rest, yaw)


def spread(
    rng: Random,
    models: Sequence[ObjectModel],
    board: Board,
    gap: float = 0.01,
    beside: int = 0,
    clearance: float = np.inf,
) -> list[tuple[ObjectModel, Array]]:
    """Lay models on a board at random without overlap: each with its pose in the board's furniture frame.

    The last ``beside`` of them go close to those before. What finds no room after some trials, or is higher than
    ``clearance``, is left out.
    """
    x0, y0, height, half_x, half_y = board
    laid: list[tuple[ObjectModel, Array]] = []
    taken: list[tuple[float, float, float]] = []
    surface = pose(np.eye(3), np.array([x0, y0, height]))
    for k, model in enumerate(models):
        rest = int(rng.integers(1, len(model.rests) + 1)) if model.rests and rng.random() < 0.2 else 0
        _, radius = footprint(model, model.resting(rest, 0.0))
        room = (max(half_x - 0.7 * radius, 0.0), max(half_y - 0.7 * radius, 0.0))
        close = taken if k >= len(models) - beside else []
        if radius > 1.3 * max(half_x, half_y) or model.size[2] > clearance:
            continue
        for _ in range(12):
            x, y = _spot(rng, room, radius, close)
            if all(np.hypot(x - a, y - b) > radius + r + gap for a, b, r in taken):
                yaw = rng.uniform(0, 2 * np.pi) if rng.random() < 0.7 else rng.normal(0, 0.3)
                laid.append((model, place_on(model, surface, x, y, yaw, rest)))
                taken.append((x, y, radius))
                break
    return laid


def _spot(
    rng: Random, room: tuple[float, float], radius: float, close: Sequence[tuple[float, float, float]]
) -> tuple[float, float]:
    """A spot within the half widths ``room``; where there are any, beside one of ``close`` (x, y, radius)."""
    if not close:
        return float(rng.uniform(-room[0], room[0])), float(rng.uniform(-room[1], room[1]))
    a, b, r = close[int(rng.integers(len(close)))]
    angle, reach = rng.uniform(0, 2 * np.pi), r + radius + 0.03
    x, y = a + reach * np.cos(angle), b + reach * np.sin(angle)
    return float(np.clip(x, -room[0], room[0])), float(np.clip(y, -room[1], room[1]))


def footprint(model: ObjectModel, T_world_object: Array) -> tuple[Array, float]:
    """The middle (2,) and a radius of the footprint: between its inner and its outer circle, hardly any overlap."""
    T = T_world_object
    xy = model.mesh.vertices @ T[:2, :3].T.astype(np.float32) + T[:2, 3].astype(np.float32)
    half = (xy.max(0) - xy.min(0)) / 2
    return (xy.max(0) + xy.min(0)) / 2, float(0.5 * (np.hypot(*half) + half.max()))


def some_models(rng: Random, count: int, distractor_share: float, labels: Sequence[str] = LABELS) -> list[ObjectModel]:
    """Models of random classes and random distractors; no chairs."""
    out = []
    for _ in range(count):
        seed = int(rng.integers(2**31))
        if rng.random() < distractor_share:
            out.append(distractors.make_distractor(str(rng.choice(list(distractors.FAMILIES))), seed))
        else:
            out.append(make_object(str(rng.choice([name for name in labels if name != "chair"])), seed))
    return out


def lamps_for(rng: Random, room: Room, count: int) -> tuple[tuple[Lamp, ...], Array]:
    """Lamps under the ceiling or beside, and the ambient light, from warm to cold."""
    warmth = rng.uniform(-0.12, 0.2)
    tone = np.array([1 + warmth, 1.0, 1 - warmth])
    lamps = []
    for _ in range(count):
        at = [
            rng.uniform(-0.7, 0.7) * room.half[0],
            rng.uniform(-0.7, 0.7) * room.half[1],
            rng.uniform(1.9, room.height - 0.1),
        ]
        colour = tone * rng.uniform(0.25, 0.9) * (1 + rng.normal(0, 0.04, 3))
        lamps.append(Lamp(np.array(at), np.clip(colour, 0.05, None)))
    return tuple(lamps), np.clip(tone * rng.uniform(0.15, 0.6), 0.05, None)


def furnished(rng: Random, pieces: Sequence[tuple[Furniture, Array]], room: Room, lamp_count: int = 2) -> Scene:
    """A room with furniture, each piece with its pose ``T_world_piece``, and nothing on it yet."""
    lamps, ambient = lamps_for(rng, room, lamp_count)
    meshes = [piece.mesh.placed(T) for piece, T in pieces]
    reach = max(room.half)
    return Scene((), (room.mesh, *meshes), lamps, ambient, (), (room.ceiling,), reach)


def number(laid: Sequence[tuple[ObjectModel, Array]]) -> tuple[Placed, ...]:
    """Placed objects from models and their poses in the world, numbered from 1."""
    return tuple(Placed(k, model, T) for k, (model, T) in enumerate(laid, 1))


def random_scene(seed: int, labels: Sequence[str] = LABELS, distractor_share: float = 0.4) -> Scene:
    """A corner of a room made at random: furniture, walls, lamps, clutter, objects of the nine classes and others.

    Everything follows from ``seed``.
    """
    rng = np.random.default_rng([seed, 1])
    half = (rng.uniform(1.8, 3.5), rng.uniform(1.8, 3.5))
    room = furniture.room(rng, half)
    pieces = _arranged(rng, room)
    laid, places = _clutter(rng, pieces, labels, distractor_share)
    if "chair" in labels:
        chairs, seats = _chairs(rng, pieces, room)
        laid, places = laid + chairs, places + seats
    scene = furnished(rng, pieces, room, int(rng.integers(1, 4)))
    middle = places[0].centre if places else np.array([0.0, 0.0, 0.75])
    return replace(scene, objects=number(laid), places=tuple(places), middle=middle, reach=2.0)


def _arranged(rng: Random, room: Room) -> list[tuple[Furniture, Array]]:
    """A table somewhere and a few pieces along the walls."""
    yaw = float(rng.choice([0, 90, 180, 270])) + rng.normal(0, 8)
    T = turn("z", yaw)
    T[:2, 3] = rng.uniform(-0.45, 0.45, 2) * room.half
    pieces = [(furniture.table(rng), T)]
    for wall in rng.permutation(4)[: int(rng.integers(1, 4))]:
        kind = (furniture.shelf, furniture.cupboard, furniture.table, furniture.sofa)[
            int(rng.choice(4, p=[0.4, 0.3, 0.15, 0.15]))
        ]
        piece = kind(rng)
        along, reach = (room.half[0], room.half[1]) if wall % 2 == 0 else (room.half[1], room.half[0])
        T = turn("z", 90.0 * wall)
        depth = float(piece.mesh.bounds[1, 1])
        T[:3, 3] = T[:3, :3] @ [rng.uniform(-0.6, 0.6) * along, reach - depth - 0.02, 0.0]
        if all(np.linalg.norm(T[:2, 3] - other[:2, 3]) > piece.floor_radius + o.floor_radius for o, other in pieces):
            pieces.append((piece, T))
    return pieces


def _clutter(
    rng: Random, pieces: Sequence[tuple[Furniture, Array]], labels: Sequence[str], share: float
) -> tuple[list[tuple[ObjectModel, Array]], list[Place]]:
    """Objects on every board, in the world, and the places where they are."""
    laid, places = [], []
    for piece, T in pieces:
        for board in piece.boards:
            count = int(rng.integers(4, 14)) if board[3] * board[4] > 0.12 else int(rng.integers(0, 6))
            models = some_models(rng, count, share, labels)
            on_board = [(m, T @ P) for m, P in spread(rng, models, board, clearance=piece.clearance)]
            laid += on_board
            if on_board:
                centre = T[:3, :3] @ [board[0], board[1], board[2] + 0.08] + T[:3, 3]
                places.append(Place(centre, max(board[3], board[4])))
    return laid, places


def _chairs(
    rng: Random, pieces: Sequence[tuple[Furniture, Array]], room: Room
) -> tuple[list[tuple[ObjectModel, Array]], list[Place]]:
    """Chairs on the floor, most at the table, and the places where they are."""
    laid: list[tuple[ObjectModel, Array]] = []
    places = []
    piece, T_table = pieces[0]
    for _ in range(int(rng.integers(1, 5))):
        model = make_object("chair", int(rng.integers(2**31)))
        angle = rng.uniform(0, 2 * np.pi)
        reach = piece.floor_radius * rng.uniform(0.85, 1.5) + 0.15
        xy = np.clip(
            T_table[:2, 3] + reach * np.array([np.cos(angle), np.sin(angle)]),
            *(s * (np.array(room.half) - 0.4) for s in (-1, 1)),
        )
        if all(np.linalg.norm(xy - T[:2, 3]) > 0.6 for _, T in laid):
            yaw = angle - np.pi / 2 + rng.normal(0, 0.6)
            laid.append((model, place_on(model, np.eye(4), float(xy[0]), float(xy[1]), yaw)))
            places.append(Place(np.array([*xy, 0.5]), 0.5))
    return laid, places


def random_view(scene: Scene, seed: int) -> Array:
    """``T_world_camera`` of a hand-held camera that looks at something in the scene, from near or far.

    It looks past one of the objects of the nine classes, at 30 to 350 px, unless that stands too well hidden.
    """
    rng = np.random.default_rng([seed, 2])
    wanted = [o for o in scene.objects if not o.is_distractor] or list(scene.objects)
    view = _view_of(scene, scene.middle, 0.5, rng)
    for _ in range(VIEW_TRIALS if wanted else 0):
        label = str(rng.choice(sorted({o.label for o in wanted})))
        target = [o for o in wanted if o.label == label][int(rng.integers(sum(o.label == label for o in wanted)))]
        extent = float(np.linalg.norm(target.model.size))
        centre = transform(target.T_world_object, target.model.mesh.vertices.astype(float)).mean(0)
        view = _view_of(scene, centre, extent, rng)
        if _shows(scene, view, target.instance):
            break
    return view


VIEW_TRIALS = 12
SKETCH = Intrinsics(fx=65.6, fy=65.6, cx=39.5, cy=29.5, width=80, height=60)
"""A camera of few pixels that finds out whether a view is any good."""


def _view_of(scene: Scene, centre: Array, extent: float, rng: Random) -> Array:
    """A view past ``centre``, at which something of this extent in metres is 30 to 350 px large."""
    pixels = np.exp(rng.uniform(np.log(30.0), np.log(350.0)))
    distance = float(np.clip(525.0 * extent / pixels, 0.5, 4.0))
    low, high = _inside(scene)
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(5, 65))
    away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    eye = np.clip(centre + distance * away, low, high)
    aside = rng.normal(0, 0.14, 3) * np.linalg.norm(eye - centre)
    return looking(eye, centre + aside, np.array([0.0, 0.0, 1.0])) @ turn("z", float(rng.normal(0, 5.0)))


def _shows(scene: Scene, T_world_camera: Array, instance: int) -> bool:
    """Whether an instance can be made out from a view that is not blocked by something right before it."""
    s = scene.surfaces
    depth, triangle = rasterise(s.vertices, s.faces, s.open_surface, T_world_camera, SKETCH)
    mask = np.where(triangle >= 0, s.instance[triangle], 0) == instance
    first, last = scene.face_range[instance]
    seen = s.vertices[s.faces[first:last]].reshape(-1, 3)
    in_camera = transform(inverse(T_world_camera), seen)
    uv = in_camera[:, :2] / np.maximum(in_camera[:, 2:], 0.1)
    outline = float(np.prod(np.ptp(uv, axis=0))) * SKETCH.fx * SKETCH.fy
    return bool(mask.sum() > max(1.0, 0.25 * outline) and np.quantile(depth, 0.05) > 0.3)


def _inside(scene: Scene) -> tuple[Array, Array]:
    """The corners of the room's free space, a little inside the walls."""
    bounds = np.array([mesh.bounds for mesh in scene.backdrop])
    low, high = bounds[:, 0].min(0), bounds[:, 1].max(0)
    margin = np.array([0.35, 0.35, 0.25])
    return low + margin, high - margin
