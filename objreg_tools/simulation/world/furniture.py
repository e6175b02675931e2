# SPDX-License-Identifier: Apache-2.0
"""Tables, shelves, cupboards and the room around them: what objects stand on and in front of."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.world import print_design, texture
from objreg_tools.simulation.world.mesh import Material, Mesh, box, cushion, merge, revolve
from objreg_tools.simulation.world.model import turn

Random = np.random.Generator


@dataclass(frozen=True, eq=False)
class Furniture:
    """A piece that stands on z = 0 around the z axis: ``mesh``, and the ``boards`` that carry things.

    A board is (centre x, centre y, height, half width, half depth) in metres; ``floor_radius`` keeps others away;
    ``clearance`` metres are free above a board.
    """

    mesh: Mesh
    boards: tuple[tuple[float, float, float, float, float], ...]
    floor_radius: float
    clearance: float = np.inf


def surface(rng: Random) -> Material:
    """The material of a table top or a cupboard."""
    kind = rng.integers(4)
    picture = (
        texture.wood(rng)
        if kind < 2
        else texture.marble(rng)
        if kind == 2 and rng.random() < 0.4
        else texture.speckled(rng, texture.grey(rng, 0.15, 0.95) if rng.random() < 0.6 else texture.muted(rng), 0.04)
    )
    return Material(picture, specular=rng.uniform(0, 0.25), gloss=int(rng.integers(3, 7)))


def table(rng: Random, size: tuple[float, float] | None = None) -> Furniture:
    """A table or a desk: square or round, on legs, sides or a column."""
    width, depth = size or (rng.uniform(0.9, 1.8), rng.uniform(0.65, 1.0))
    height, thick = rng.uniform(0.68, 0.78), rng.uniform(0.018, 0.05)
    top, frame = surface(rng), surface(rng)
    if size is None and rng.random() < 0.2:
        radius = rng.uniform(0.42, 0.65)
        plate = revolve(
            np.array([(0.001, thick), (radius, thick), (radius, 0.0), (0.001, 0)]), top, 40, uv=(0, 0, 3, 3)
        )
        foot = revolve(np.array([(0.04, height), (0.04, 0.04), (0.3, 0.0)]), frame, 24)
        half = radius / np.sqrt(2)
        return Furniture(
            merge([_planar(plate, 0.8).moved(z=height - thick), foot]), ((0, 0, height, half, half),), radius
        )
    parts = [box((width, depth, thick), top, tile=rng.uniform(0.5, 1.2)).moved(z=height - thick)]
    parts += _supports(rng, width, depth, height - thick, frame)
    board = (0.0, 0.0, height, width / 2 - 0.03, depth / 2 - 0.03)
    return Furniture(merge(parts), (board,), float(np.hypot(width, depth)) / 2)


def _planar(mesh: Mesh, tile: float) -> Mesh:
    """The mesh with its texture laid on from above, ``tile`` metres per texture."""
    mesh.uv[:] = mesh.vertices[:, :2] / tile
    return mesh


def _supports(rng: Random, width: float, depth: float, height: float, frame: Material) -> list[Mesh]:
    if rng.random() < 0.3:
        return [box((0.03, depth * 0.95, height), frame, tile=0.8).moved(x=s * (width / 2 - 0.04)) for s in (-1, 1)]
    leg = rng.uniform(0.03, 0.08)
    x, y = width / 2 - leg, depth / 2 - leg
    legs = [box((leg, leg, height), frame, tile=0.8).moved(sx * x, sy * y) for sx in (-1, 1) for sy in (-1, 1)]
    rails = [box((width - 2 * leg, 0.02, 0.07), frame, tile=0.8).moved(0, s * y, height - 0.07) for s in (-1, 1)]
    return legs + rails


def shelf(rng: Random) -> Furniture:
    """An open bookcase, its back to +y."""
    width, depth = rng.uniform(0.7, 1.3), rng.uniform(0.28, 0.36)
    levels, gap = int(rng.integers(3, 6)), rng.uniform(0.34, 0.42)
    wood, thick = surface(rng), 0.02
    height = levels * gap + thick
    parts = [box((width, depth, thick), wood, tile=0.8).moved(z=k * gap) for k in range(levels + 1)]
    parts += [box((thick, depth, height), wood, tile=0.8).moved(x=s * (width - thick) / 2) for s in (-1, 1)]
    parts.append(box((width, 0.006, height), wood, tile=0.8).moved(y=depth / 2))
    boards = tuple((0.0, -0.02, k * gap + thick, width / 2 - 0.04, depth / 2 - 0.03) for k in range(levels + 1))
    return Furniture(merge(parts), boards, width / 2, clearance=gap - thick - 0.01)


def cupboard(rng: Random) -> Furniture:
    """A closed sideboard with doors, its back to +y."""
    width, depth, height = rng.uniform(0.8, 1.7), rng.uniform(0.38, 0.55), rng.uniform(0.7, 1.1)
    wood, door = surface(rng), surface(rng)
    count = int(rng.integers(2, 5))
    parts = [box((width, depth, height), wood, tile=0.8)]
    knob = Material(texture.brushed(rng), specular=0.5)
    for k in range(count):
        x = (k + 0.5) * width / count - width / 2
        parts.append(box((width / count - 0.02, 0.018, height - 0.06), door, tile=0.8).moved(x, -depth / 2, 0.03))
        parts.append(cushion((0.025, 0.03, 0.025), knob, 2.5).moved(x, -depth / 2 - 0.02, height * 0.55))
    return Furniture(merge(parts), ((0.0, 0.0, height, width / 2 - 0.03, depth / 2 - 0.03),), width / 2)


def sofa(rng: Random) -> Furniture:
    """A seat for two or three, its back to +y; nothing stands on it."""
    width, cloth = rng.uniform(1.4, 2.1), Material(texture.fabric(rng), specular=0.0)
    parts = [cushion((width, 0.85, 0.42), cloth, 8, 0.4), cushion((width, 0.25, 0.8), cloth, 8, 0.4).moved(y=0.32)]
    parts += [cushion((0.2, 0.85, 0.6), cloth, 8, 0.4).moved(x=s * width / 2) for s in (-1, 1)]
    return Furniture(merge(parts), (), width / 2 + 0.1)


@dataclass(frozen=True, eq=False)
class Room:
    """Floor, ceiling and four walls; ``half`` (x, y) in metres from the centre, the floor at z = 0."""

    half: tuple[float, float]
    height: float
    mesh: Mesh
    ceiling: Mesh


OPENING = (1.2, 2.1)
"""Width and height of an opening in a wall, metres."""
POSTER = (0.6, 0.8, 1.1)
"""Width, height and height above the floor of posters that hang more than once, metres."""
OVERHANG_M = 1.0
"""So far what hangs on a wall may reach beyond the right end of the length that it is given."""


def room(
    rng: Random,
    half: tuple[float, float],
    height: float = 2.7,
    open_to: Collection[float] = (),
    posters: Sequence[Material] = (),
) -> Room:
    """A room of the given half widths with pictures, a window, a door, skirting, and perhaps a rug.

    ``open_to`` are the walls with an opening in their middle that one walks through, each by the degrees by which it is
    turned from that at +y: 90 is the wall at -x, 270 that at +x. Every picture is one of the ``posters``, where there
    are any, at the same size and height.
    """
    x, y = half
    floor = _floor_material(rng)
    parts = [box((2 * x, 2 * y, 0.1), floor, tile=rng.uniform(0.8, 2.0)).moved(z=-0.1)]
    paint = [_wall_material(rng)] * 4 if rng.random() < 0.6 else [_wall_material(rng) for _ in range(4)]
    skirting = Material(texture.speckled(rng, texture.grey(rng), 0.02))
    for k, (degrees, T, length) in enumerate(_walls(half)):
        if degrees in open_to:
            wall = _open_wall(rng, length, height, paint[k], skirting, floor, posters)
        else:
            wall = _wall(rng, length, height, paint[k], skirting, posters)
        parts += [mesh.placed(T) for mesh in wall]
    if rng.random() < 0.5:
        rug = box((rng.uniform(1.2, 2.4), rng.uniform(1.0, 2.0), 0.006), Material(texture.fabric(rng), 0.0), tile=1.0)
        parts.append(rug.placed(turn("z", rng.uniform(0, 360))).moved(*rng.uniform(-0.4, 0.4, 2) * half))
    white = Material(texture.speckled(rng, texture.grey(rng, 0.8, 1.0), 0.02))
    ceiling = box((2 * x + 0.2, 2 * y + 0.2, 0.1), white, tile=1.5).moved(z=height)
    return Room(half, height, merge(parts), ceiling)


def _wall(
    rng: Random, length: float, height: float, paint: Material, skirting: Material, posters: Sequence[Material]
) -> list[Mesh]:
    """A wall in its own frame with what hangs on it."""
    wall = box((length + 0.2, 0.1, height), paint, tile=rng.uniform(1.0, 3.0)).moved(y=0.05)
    base = box((length, 0.015, rng.uniform(0.05, 0.1)), skirting).moved(y=-0.007)
    return [wall, base, *_decoration(rng, length, height, posters)]


def _open_wall(
    rng: Random,
    length: float,
    height: float,
    paint: Material,
    skirting: Material,
    floor: Material,
    posters: Sequence[Material],
) -> list[Mesh]:
    """A wall in its own frame with an opening in its middle: two short walls, a lintel and a threshold."""
    width, tall = OPENING
    side = (length - width) / 2
    short = box((side, 0.1, height), paint, tile=rng.uniform(1.0, 3.0)).moved(y=0.05)
    base = box((side, 0.015, rng.uniform(0.05, 0.1)), skirting).moved(y=-0.007)
    lintel = box((width, 0.1, height - tall), paint, tile=2.0).moved(0.0, 0.05, tall)
    parts = [lintel, box((width, 0.1, 0.1), floor, tile=1.0).moved(0.0, 0.05, -0.1)]
    for middle in (-(width + side) / 2, (width + side) / 2):
        hung = [mesh.moved(x=-OVERHANG_M / 2) for mesh in _decoration(rng, side - OVERHANG_M, height, posters)]
        parts += [mesh.moved(x=middle) for mesh in (short, base, *hung)]
    return parts


def _walls(half: tuple[float, float]) -> list[tuple[int, Array, float]]:
    """Degrees, pose and length of each wall: in its own frame it runs along x and looks to -y."""
    poses = []
    for degrees, reach, length in ((0, half[1], 2 * half[0]), (90, half[0], 2 * half[1])):
        for flip in (0, 180):
            T = turn("z", degrees + flip)
            T[:3, 3] = T[:3, :3] @ [0.0, reach, 0.0]
            poses.append((degrees + flip, T, length))
    return poses


def _floor_material(rng: Random) -> Material:
    kind = rng.integers(4)
    if kind == 0:
        return Material(texture.tiles(rng), specular=rng.uniform(0, 0.2), gloss=5)
    if kind == 1:
        return Material(texture.speckled(rng, texture.muted(rng), rng.uniform(0.08, 0.25), 256), specular=0.0)
    return Material(texture.wood(rng, 512), specular=rng.uniform(0, 0.2), gloss=4)


def _wall_material(rng: Random) -> Material:
    kind = rng.random()
    if kind < 0.75:
        return Material(texture.speckled(rng, texture.pastel(rng), 0.03, 256), specular=0.0)
    picture = (
        texture.stripes(rng, rows=False) if kind < 0.82 else texture.tiles(rng) if kind < 0.9 else texture.wood(rng)
    )
    return Material(picture, specular=0.02)


def _decoration(rng: Random, length: float, height: float, posters: Sequence[Material]) -> list[Mesh]:
    """Pictures, a window or a door on a wall, side by side."""
    out, x = [], -length / 2 + rng.uniform(0.2, 0.8)
    while x < length / 2 - 0.5:
        width = float(rng.uniform(0.25, 1.1))
        kind = rng.random()
        if kind < 0.5 and posters:
            width, tall, bottom = POSTER
            out.append(_flat(x, width, bottom, tall, posters[int(rng.integers(len(posters)))]))
        elif kind < 0.5:
            tall = width * rng.uniform(0.6, 1.4)
            frame = Material(print_design.poster(rng), specular=rng.uniform(0, 0.2), gloss=6)
            out.append(_flat(x, width, rng.uniform(1.0, 1.5), min(tall, 1.0), frame))
        elif kind < 0.65:
            out += _window(rng, x, width + 0.4)
            width += 0.4
        elif kind < 0.75:
            leaf = Material(texture.wood(rng), specular=0.1)
            out.append(box((0.85, 0.04, min(2.05, height)), leaf, tile=0.9).moved(x + 0.425))
            width = 0.85
        x += width + rng.uniform(0.15, 1.5)
    return out


def _flat(x: float, width: float, bottom: float, tall: float, material: Material) -> Mesh:
    """A thin panel on the wall from ``x`` to the right."""
    return box((width, 0.02, tall), material).moved(x + width / 2, -0.01, bottom)


def _window(rng: Random, x: float, width: float) -> list[Mesh]:
    light = Material(texture.speckled(rng, (235, 240, 250), 0.02), emission=rng.uniform(0.5, 1.5), depth_loss=0.85)
    bars = Material(texture.speckled(rng, texture.grey(rng, 0.6, 1.0), 0.02))
    parts = [_flat(x, width, 0.95, 1.15, light)]
    for place in (0.0, 0.5, 1.0):
        parts.append(box((0.05, 0.05, 1.2), bars).moved(x + place * width, -0.01, 0.93))
    parts += [box((width, 0.05, 0.05), bars).moved(x + width / 2, -0.01, z) for z in (0.92, 2.08)]
    return parts
