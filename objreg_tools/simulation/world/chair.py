# SPDX-License-Identifier: Apache-2.0
"""Chairs: wooden ones with four legs, plastic shells on tubes, and swivel chairs on a star of castors."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.world import texture
from objreg_tools.simulation.world.mesh import Material, Mesh, box, cushion, merge, sheet, tube
from objreg_tools.simulation.world.model import ObjectModel, Symmetry

Random = np.random.Generator


def chair(rng: Random) -> ObjectModel:
    """A chair that stands on the floor, its seat open to -y. No symmetry."""
    style = (_wooden, _shell, _swivel)[int(rng.integers(3))]
    mesh = style(rng)
    centre = np.array([0, 0, float(mesh.bounds[1, 2]) / 2])
    return ObjectModel("chair", mesh, Symmetry(centre=centre), on_floor=True)


def _frame_material(rng: Random) -> Material:
    kind = rng.integers(3)
    if kind == 0:
        return Material(texture.wood(rng), specular=0.08)
    if kind == 1:
        return Material(texture.brushed(rng), specular=0.4, gloss=5)
    return Material(texture.speckled(rng, texture.muted(rng), 0.03), specular=0.1)


def _seat_material(rng: Random) -> Material:
    kind = rng.integers(3)
    if kind == 0:
        return Material(texture.fabric(rng, texture.muted(rng)), specular=0.0)
    colour = texture.grey(rng, 0.03, 0.3) if rng.random() < 0.4 else texture.muted(rng)
    return Material(texture.speckled(rng, colour, 0.06), specular=rng.uniform(0, 0.15))


def _wooden(rng: Random) -> Mesh:
    """Four square legs, a seat, and a back of slats or spindles."""
    wood = Material(texture.wood(rng), specular=0.1) if rng.random() < 0.7 else _frame_material(rng)
    width, depth, seat = rng.uniform(0.38, 0.48), rng.uniform(0.38, 0.46), rng.uniform(0.42, 0.47)
    back, leg = rng.uniform(0.36, 0.55), rng.uniform(0.025, 0.045)
    x, y = width / 2 - leg / 2, depth / 2 - leg / 2
    parts = [box((leg, leg, seat), wood, tile=0.5).moved(sx * x, sy * y) for sx in (-1, 1) for sy in (-1, 1)]
    parts.append(box((width, depth, 0.025), wood, tile=0.5).moved(z=seat))
    parts += [box((leg, leg * 0.8, back), wood, tile=0.5).moved(sx * x, y, seat + 0.025) for sx in (-1, 1)]
    if rng.random() < 0.4:
        parts.append(cushion((width * 0.95, depth * 0.9, 0.045), _seat_material(rng)).moved(z=seat + 0.022))
    parts += _slats(rng, wood, width, back).moved_to(y, seat + 0.025)
    parts += [box((width - leg, 0.018, 0.03), wood, tile=0.5).moved(0, sy * y, seat * 0.4) for sy in (-1, 1)]
    return merge(parts)


class _Slats(list[Mesh]):
    """The slats of a back rest, at y = 0 above z = 0."""

    def moved_to(self, y: float, z: float) -> list[Mesh]:
        return [slat.moved(y=y, z=z) for slat in self]


def _slats(rng: Random, wood: Material, width: float, back: float) -> _Slats:
    top = box((width, 0.02, 0.07), wood, tile=0.5).moved(z=back - 0.07)
    count, kind = int(rng.integers(2, 6)), rng.integers(3)
    if kind == 0:
        heights = np.linspace(0.12, 0.7, count) * back
        return _Slats([top, *(box((width * 0.92, 0.015, 0.045), wood, tile=0.5).moved(z=z) for z in heights)])
    if kind == 1:
        places = np.linspace(-0.38, 0.38, count + 2) * width
        return _Slats([top, *(box((0.018, 0.015, back), wood, tile=0.5).moved(x=x) for x in places)])
    return _Slats([box((width * 0.94, 0.02, back * rng.uniform(0.4, 0.75)), wood, tile=0.5).moved(z=back * 0.25), top])


def _shell(rng: Random) -> Mesh:
    """A moulded seat and back in one piece on legs of bent tube."""
    width, depth, seat = rng.uniform(0.42, 0.5), rng.uniform(0.4, 0.46), rng.uniform(0.43, 0.46)
    back, plastic, frame = rng.uniform(0.32, 0.45), _seat_material(rng), _frame_material(rng)
    profile = _shell_profile(depth, back)
    across = np.linspace(-1, 1, 9)
    lip = rng.uniform(0.01, 0.05) * across**2
    grid = np.stack(
        [np.stack([across * width / 2 * s, y - lip * n[0], z + seat + lip * n[1]], -1) for y, z, s, n in profile]
    )
    shell = sheet(grid[::-1], plastic).two_sided()
    splay = rng.uniform(0.0, 0.05)
    parts: list[Mesh] = [shell]
    for sx in (-1, 1):
        for sy in (-1, 1):
            x, y = sx * width * 0.36, sy * depth * 0.36
            path = np.array([(x, y, seat + 0.005), (x + sx * splay, y + sy * splay, 0.0)])
            parts.append(tube(path, rng.uniform(0.0095, 0.0105), frame, 8))
    return merge(parts)


def _shell_profile(depth: float, back: float) -> list[tuple[float, float, float, tuple[float, float]]]:
    """(y, z, width share, inward normal in y and z) from the front edge of the seat to the top of the back."""
    seat = [(y, -0.012 * np.cos(y / depth * np.pi), 1.0, (0.0, 1.0)) for y in np.linspace(-0.5, 0.3, 6) * depth]
    bend = [
        (0.3 * depth + 0.2 * depth * np.sin(a), 0.2 * depth * (1 - np.cos(a)) - 0.007, 1.0, (np.sin(a), np.cos(a)))
        for a in np.radians([20, 40, 60, 80])
    ]
    y0, z0 = bend[-1][0], bend[-1][1]
    rest = [(y0 + 0.06 * s, z0 + back * s, 1.0 - 0.25 * s**3, (1.0, 0.0)) for s in np.linspace(0.15, 1, 6)]
    return seat + bend + rest


def _swivel(rng: Random) -> Mesh:
    """An office chair: a star of five castors, a gas spring, a padded seat and back, perhaps armrests."""
    seat, cloth = rng.uniform(0.42, 0.52), _seat_material(rng)
    dark = Material(texture.speckled(rng, texture.grey(rng, 0.03, 0.3), 0.03), specular=0.15)
    width, depth, back = rng.uniform(0.42, 0.52), rng.uniform(0.42, 0.5), rng.uniform(0.38, 0.65)
    parts = [tube(np.array([(0, 0, 0.07), (0, 0, seat)]), 0.025, _frame_material(rng), 10)]
    phase = rng.uniform(0, 2 * np.pi)
    for angle in phase + np.arange(5) * 2 * np.pi / 5:
        parts += _castor_arm(angle, rng.uniform(0.26, 0.3), dark)
    parts.append(cushion((width, depth, rng.uniform(0.06, 0.1)), cloth, rng.uniform(3, 7)).moved(z=seat))
    lean = _leaning(
        cushion((width * 0.92, rng.uniform(0.05, 0.1), back), cloth, rng.uniform(3, 7)), rng.uniform(0, 0.25)
    )
    gap = rng.uniform(0.05, 0.15)
    parts.append(lean.moved(y=depth / 2, z=seat + gap))
    post = np.array(
        [(0, depth * 0.2, seat + 0.01), (0, depth / 2 + 0.05, seat + 0.03), (0, depth / 2 + 0.05, seat + 0.3)]
    )
    parts.append(tube(post, 0.022, dark, 8))
    if rng.random() < 0.5:
        for sx in (-1, 1):
            parts += _armrest(sx * (width / 2 + 0.03), seat, dark)
    return merge(parts)


def _castor_arm(angle: float, reach: float, dark: Material) -> list[Mesh]:
    outer = np.array([np.cos(angle), np.sin(angle), 0.0])
    arm = tube(np.array([outer * 0.02 + [0, 0, 0.1], outer * reach + [0, 0, 0.065]]), 0.02, dark, 8)
    wheel = cushion((0.05, 0.05, 0.055), dark, 2.5).moved(*(outer * reach)[:2])
    return [arm, wheel]


def _armrest(x: float, seat: float, dark: Material) -> list[Mesh]:
    post = tube(np.array([(x * 0.8, 0.05, seat + 0.02), (x, 0.05, seat + 0.04), (x, 0.05, seat + 0.2)]), 0.014, dark, 8)
    return [post, cushion((0.06, 0.26, 0.03), dark, 5.0).moved(x, 0.02, seat + 0.2)]


def _leaning(mesh: Mesh, slope: float) -> Mesh:
    """The mesh sheared backwards (+y) by ``slope`` metres per metre of height."""
    shear: Array = mesh.vertices.copy()
    shear[:, 1] += slope * shear[:, 2]
    return Mesh(
        vertices=shear,
        normals=mesh.normals,
        uv=mesh.uv,
        faces=mesh.faces,
        material=mesh.material,
        materials=mesh.materials,
        open_surface=mesh.open_surface,
    )
