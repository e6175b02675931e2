# SPDX-License-Identifier: Apache-2.0
"""Things that are none of the nine classes: clutter, decoys of similar shape, and the texture of daily life."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from objreg_tools.simulation.world import print_design, texture
from objreg_tools.simulation.world.mesh import Material, box, cushion, disc, merge, revolve, sheet, tube
from objreg_tools.simulation.world.model import ObjectModel, Symmetry, half_turns, revolution, turn

Random = np.random.Generator


def _any_material(rng: Random) -> Material:
    return Material(texture.any_surface(rng), specular=rng.uniform(0, 0.4), gloss=int(rng.integers(3, 7)))


def _plain_material(rng: Random) -> Material:
    return Material(texture.speckled(rng, texture.muted(rng), 0.03), specular=rng.uniform(0, 0.4), gloss=5)


def mug(rng: Random) -> ObjectModel:
    """A cup with a handle."""
    radius, height = rng.uniform(0.033, 0.05), rng.uniform(0.07, 0.12)
    material = _any_material(rng) if rng.random() < 0.5 else _plain_material(rng)
    foot = rng.uniform(0.7, 1.0) * radius
    outside = [(radius * 0.94, height), (radius, height), (foot, 0.0), (0.001, 0.0)]
    inside = [(0.001, 0.006), (foot * 0.9, 0.006), (radius * 0.94, height)]
    angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
    reach = rng.uniform(0.02, 0.035)
    handle = np.stack(
        [radius * 0.92 + reach * np.cos(angle), 0 * angle, height / 2 + height * 0.32 * np.sin(angle)], -1
    )
    parts = [revolve(np.array(outside), material, 28), revolve(np.array(inside), _plain_material(rng), 28)]
    return ObjectModel("mug", merge([*parts, tube(handle, 0.005, material, 8)]), Symmetry())


def bottle(rng: Random) -> ObjectModel:
    """A bottle with a neck, a cap and a label."""
    radius, height = rng.uniform(0.028, 0.048), rng.uniform(0.18, 0.33)
    shoulder, neck = rng.uniform(0.5, 0.75), rng.uniform(0.25, 0.45)
    glass = _plain_material(rng)
    body = [
        (neck * radius, 0.92),
        (neck * radius, shoulder + 0.15),
        (radius, shoulder),
        (radius, 0.02),
        (0.9 * radius, 0),
    ]
    parts = [revolve(np.array([*body, (0.001, 0.0)]), glass, 28)]
    parts.append(
        revolve(np.array([(0.001, 1), (neck * radius * 1.1, 1), (neck * radius * 1.1, 0.91)]), _plain_material(rng), 20)
    )
    band = Material(print_design.can_label(rng), specular=0.1)
    parts.append(revolve(np.array([(radius * 1.01, shoulder * 0.85), (radius * 1.01, 0.15)]), band, 28))
    mesh = merge([part.scaled(1, 1, height) for part in parts])
    return ObjectModel("bottle", mesh, revolution("z", np.array([0, 0, height / 2])), rests=(turn("x", 90.0),))


def carton(rng: Random) -> ObjectModel:
    """A plain or brown box of any proportions."""
    size = rng.uniform(0.04, 0.25, 3)
    brown = Material(texture.speckled(rng, texture.hsv(0.09, 0.45, rng.uniform(0.5, 0.8)), 0.05), specular=0.0)
    material = brown if rng.random() < 0.4 else _any_material(rng)
    return ObjectModel("carton", box(size, material), half_turns(size * [0, 0, 0.5]), rests=(turn("x", 90.0),))


def vase(rng: Random) -> ObjectModel:
    """A turned vessel of random outline."""
    height, steps = rng.uniform(0.1, 0.32), np.linspace(1, 0, 12)
    waves = 1 + 0.35 * np.sin(steps * rng.uniform(2, 7) + rng.uniform(0, 6))
    profile = np.stack([rng.uniform(0.03, 0.07) * waves, steps * height], -1)
    inner = np.array([(0.001, height * 0.6), (profile[0, 0] * 0.85, height), (profile[0, 0], height)])
    material = _any_material(rng)
    mesh = merge([revolve(np.concatenate([profile, [(0.001, 0)]]), material, 28), revolve(inner, material, 28)])
    return ObjectModel("vase", mesh, revolution("z", np.array([0, 0, height / 2])))


def lamp(rng: Random) -> ObjectModel:
    """A table lamp: foot, stem and shade."""
    height, radius = rng.uniform(0.28, 0.5), rng.uniform(0.07, 0.15)
    stem = _plain_material(rng)
    shade = Material(texture.speckled(rng, texture.pastel(rng), 0.02), emission=float(rng.choice([0.0, 0.9])))
    parts = [
        revolve(np.array([(0.001, 0.02), (0.06, 0.015), (0.07, 0.0)]), stem, 24),
        tube(np.array([(0, 0, 0.01), (0, 0, height * 0.8)]), 0.007, stem, 8),
        revolve(np.array([(radius * rng.uniform(0.4, 0.95), height), (radius, height * 0.6)]), shade, 28).two_sided(),
    ]
    return ObjectModel("lamp", merge(parts), revolution("z", np.array([0, 0, height / 2])))


def ball(rng: Random) -> ObjectModel:
    """A ball or a fruit."""
    diameter = rng.uniform(0.05, 0.2)
    mesh = cushion((diameter, diameter, diameter * rng.uniform(0.85, 1.0)), _any_material(rng), 2.0)
    return ObjectModel("ball", mesh, revolution("z", np.array([0, 0, diameter / 2])))


def plant(rng: Random) -> ObjectModel:
    """Leaves in a pot."""
    pot, tall = rng.uniform(0.04, 0.09), rng.uniform(0.1, 0.3)
    clay = _plain_material(rng)
    outline = np.array([(0.001, pot * 1.4), (pot * 0.9, pot * 1.4), (pot, pot * 1.5), (pot * 0.75, 0.0), (0.001, 0.0)])
    green = Material(texture.speckled(rng, texture.hsv(rng.uniform(0.2, 0.4), 0.7, rng.uniform(0.3, 0.7)), 0.2), 0.1)
    parts = [revolve(outline, clay, 24)]
    for _ in range(int(rng.integers(8, 26))):
        parts.append(_leaf(rng, tall, green).moved(z=pot * 1.4))
    return ObjectModel("plant", merge(parts), Symmetry())


def _leaf(rng: Random, tall: float, green: Material):  # type: ignore[no-untyped-def]
    angle, lean, wide = rng.uniform(0, 2 * np.pi), rng.uniform(0.1, 1.0), rng.uniform(0.006, 0.035)
    s = np.linspace(0, 1, 6)
    height = tall * rng.uniform(0.6, 1.0)
    out, rise = height * lean * s**1.5, height * s * (1 - 0.4 * lean * s)
    half = wide * np.sin(np.pi * np.clip(s, 0.05, 0.97))
    centre = np.stack([out * np.cos(angle), out * np.sin(angle), rise], -1)
    side = np.array([-np.sin(angle), np.cos(angle), 0.0])
    return sheet(np.stack([centre - half[:, None] * side, centre + half[:, None] * side]), green).two_sided()


def mouse(rng: Random) -> ObjectModel:
    """A computer mouse."""
    size = (rng.uniform(0.055, 0.07), rng.uniform(0.095, 0.125), rng.uniform(0.03, 0.042))
    shell = Material(texture.speckled(rng, texture.grey(rng), 0.02), specular=0.2)
    wheel = cushion((0.008, 0.02, 0.01), _plain_material(rng), 2.5).moved(0, size[1] * 0.28, size[2] * 0.8)
    return ObjectModel("mouse", merge([cushion(size, shell, 3.0), wheel]), Symmetry())


def plate(rng: Random) -> ObjectModel:
    """A flat dish."""
    radius = rng.uniform(0.08, 0.14)
    glaze = _plain_material(rng)
    outline = [
        (0.001, 0.006),
        (radius * 0.6, 0.006),
        (radius, 0.02),
        (radius * 0.98, 0.017),
        (radius * 0.55, 0.0),
        (0.001, 0.0),
    ]
    return ObjectModel("plate", revolve(np.array(outline), glaze, 32), revolution("z", np.zeros(3)))


def tin(rng: Random) -> ObjectModel:
    """A jar or a box of tin that is wider than a drinks can."""
    radius = rng.uniform(0.045, 0.08)
    height = radius * rng.uniform(0.6, 2.2)
    wall = Material(texture.any_surface(rng), specular=0.2)
    cover = _plain_material(rng)
    parts = [
        revolve(np.array([(radius, height * 0.85), (radius, 0.0), (0.001, 0.0)]), wall, 28),
        revolve(np.array([(0.001, height), (radius * 1.03, height), (radius * 1.03, height * 0.82)]), cover, 28),
    ]
    return ObjectModel("tin", merge(parts), revolution("z", np.array([0, 0, height / 2])))


def phone(rng: Random) -> ObjectModel:
    """A flat slab with a screen: a telephone, a tablet or a remote control."""
    width = rng.uniform(0.045, 0.17)
    size = (width, width * rng.uniform(1.3, 3.5), rng.uniform(0.007, 0.022))
    shell = Material(texture.speckled(rng, texture.grey(rng, 0.02, 0.6), 0.02), specular=0.3, gloss=6)
    mesh = box(size, shell)
    if rng.random() < 0.6:
        dark = Material(texture.speckled(rng, texture.grey(rng, 0.02, 0.1), 0.0, 64), specular=0.3, gloss=6)
        on = Material(print_design.screen(rng), specular=0.1, emission=0.6)
        pane = box((size[0] * 0.9, size[1] * 0.85, 0.001), on if rng.random() < 0.5 else dark).moved(z=size[2])
        mesh = merge([mesh, pane])
    return ObjectModel("phone", mesh, half_turns(np.array([0, 0, size[2] / 2])))


def stick(rng: Random) -> ObjectModel:
    """A pen, a brush or a roll, lying."""
    radius, length = rng.uniform(0.003, 0.03), rng.uniform(0.1, 0.3)
    parts = [tube(np.array([(-length / 2, 0, radius), (length * 0.3, 0, radius)]), radius, _any_material(rng), 16)]
    parts.append(
        tube(np.array([(length * 0.3, 0, radius), (length / 2, 0, radius)]), radius * 0.9, _plain_material(rng), 16)
    )
    return ObjectModel("stick", merge(parts).moved(z=0.0), revolution("x", np.array([0, 0, radius])))


def papers(rng: Random) -> ObjectModel:
    """A few printed sheets."""
    parts = []
    for k in range(int(rng.integers(1, 4))):
        page = Material(print_design.printed_page(rng), specular=0.02)
        sheet_of_paper = box((0.21, 0.297, 0.0008), page).placed(turn("z", rng.uniform(-25, 25)))
        parts.append(sheet_of_paper.moved(rng.uniform(-0.04, 0.04), rng.uniform(-0.04, 0.04), 0.0008 * k))
    return ObjectModel("papers", merge(parts), Symmetry())


def clock(rng: Random) -> ObjectModel:
    """A round or square face on a thick body, standing."""
    radius = rng.uniform(0.04, 0.1)
    face = disc(radius, Material(texture.patches(rng, 128))).moved(z=0.03)
    body = revolve(np.array([(radius, 0.03), (radius, 0.0), (0.001, 0.0)]), _plain_material(rng), 28)
    return ObjectModel("clock", merge([face, body]).placed(turn("x", 90.0)).moved(z=radius), Symmetry())


FAMILIES: dict[str, Callable[[Random], ObjectModel]] = {
    family.__name__: family
    for family in (
        mug,
        bottle,
        carton,
        vase,
        lamp,
        ball,
        plant,
        mouse,
        plate,
        tin,
        phone,
        stick,
        papers,
        clock,
    )
}


def make_distractor(name: str, seed: int) -> ObjectModel:
    """The instance number ``seed`` of a kind of distractor; ValueError if there is no such kind."""
    if name not in FAMILIES:
        raise ValueError(f"expected one of {', '.join(FAMILIES)}, got {name!r}")
    return FAMILIES[name](np.random.default_rng([100 + list(FAMILIES).index(name), seed]))
