# SPDX-License-Identifier: Apache-2.0
"""The nine object classes, each a family of shapes with continuous variation of size, proportions, print and colour.

Every function makes one instance from a random generator: it stands on z = 0, centred on the z axis, z up; where a
thing has a front, it faces -y (a monitor's screen, a chair's seat, a cereal box's print), a cap's brim and a
flashlight's lens point to +x.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.world import print_design, texture
from objreg_tools.simulation.world.chair import chair
from objreg_tools.simulation.world.mesh import Material, Mesh, box, boxes, cushion, disc, merge, revolve, sheet, tube
from objreg_tools.simulation.world.model import ObjectModel, Symmetry, half_turns, revolution, turn

Random = np.random.Generator


def _plastic(rng: Random, colour: texture.Colour | None = None) -> Material:
    picture = texture.speckled(rng, colour or texture.muted(rng), rng.uniform(0, 0.04), 64)
    return Material(picture, specular=rng.uniform(0.02, 0.25), gloss=int(rng.integers(3, 7)))


def _metal(rng: Random) -> Material:
    return Material(
        texture.brushed(rng), specular=rng.uniform(0.3, 0.7), gloss=int(rng.integers(4, 7)), depth_loss=0.08
    )


def soda_can(rng: Random) -> ObjectModel:
    """A drinks can of 150 to 500 ml: a body of revolution about z, standing or lying."""
    kind = rng.integers(3)
    radius = (rng.uniform(0.032, 0.034), rng.uniform(0.026, 0.030), rng.uniform(0.028, 0.036))[kind]
    height = (rng.uniform(0.113, 0.125), rng.uniform(0.13, 0.158), rng.uniform(0.10, 0.17))[kind]
    neck = rng.uniform(0.78, 0.86)
    label = Material(print_design.can_label(rng), specular=rng.uniform(0.15, 0.5), gloss=5)
    metal = _metal(rng)
    wall = revolve(np.array([(radius, height - 0.014), (radius, 0.009)]), label, 36)
    top = [
        (0.001, -0.005),
        (neck - 0.08, -0.005),
        (neck - 0.05, 0.0),
        (neck, 0.0),
        (neck + 0.01, -0.002),
        (1.0, -0.014),
    ]
    lid = revolve(np.array([(r * radius, height + dz) for r, dz in top]), metal, 36)
    foot = revolve(np.array([(radius, 0.009), (0.8 * radius, 0.0), (0.72 * radius, 0.0), (0.001, 0.006)]), metal, 36)
    tab = box((0.022, 0.012, 0.0015), metal).moved(x=0.006, z=height - 0.0048)
    mesh = merge([wall, lid, foot, tab])
    return ObjectModel("soda_can", mesh, revolution("z", np.array([0, 0, height / 2])), rests=(turn("x", 90.0),))


def cereal_box(rng: Random) -> ObjectModel:
    """A printed carton, taller than wide and wider than deep; half turns leave its shape as it is."""
    size = np.array([rng.uniform(0.15, 0.22), rng.uniform(0.045, 0.085), rng.uniform(0.20, 0.34)])
    card = Material(print_design.cereal_box(rng), specular=rng.uniform(0.0, 0.12), gloss=3)
    mesh = box(size, card, print_design.CEREAL_BOX_ATLAS)
    return ObjectModel("cereal_box", mesh, half_turns(size * [0, 0, 0.5]), rests=(turn("x", -90.0), turn("y", 90.0)))


def book(rng: Random) -> ObjectModel:
    """A closed book that lies on its back; half turns leave its shape as it is. It also stands, as on a shelf."""
    height, thickness = rng.uniform(0.16, 0.31), rng.uniform(0.012, 0.055)
    width = height * rng.uniform(0.62, 0.82)
    cover_thickness = rng.uniform(0.0008, 0.003)
    hang = cover_thickness if cover_thickness < 0.0015 else rng.uniform(0.002, 0.005)
    cover = Material(print_design.book_cover(rng), specular=rng.uniform(0.0, 0.25), gloss=int(rng.integers(3, 6)))
    paper = Material(print_design.page_edges(rng), specular=0.0)
    board = (width, height, cover_thickness)
    parts = [
        box(board, cover, {"top": print_design.BOOK_FRONT}).moved(z=thickness - cover_thickness),
        box(board, cover, {"bottom": print_design.BOOK_BACK}),
        box((width - 2 * hang, height - 2 * hang, thickness - 2 * cover_thickness), paper).moved(z=cover_thickness),
        _spine(rng, height, thickness, cover).moved(x=-width / 2),
    ]
    rests = (turn("y", -90.0), turn("x", 90.0), turn("y", 180.0))
    return ObjectModel("book", merge(parts), half_turns(np.array([0, 0, thickness / 2])), rests=rests)


def _spine(rng: Random, height: float, thickness: float, cover: Material) -> Mesh:
    """The back of a book at x = 0, straight or rounded, of the print's spine."""
    bulge = thickness * rng.choice([0.02, rng.uniform(0.1, 0.25)])
    angle = np.linspace(0, np.pi, 7)
    x, z = -bulge * np.sin(angle), thickness * (1 + np.cos(angle)) / 2
    rows = [np.stack([x, np.full(7, y), z], -1) for y in (height / 2, -height / 2)]
    return sheet(np.stack(rows), cover, print_design.BOOK_SPINE).two_sided()


def bowl(rng: Random) -> ObjectModel:
    """An open bowl: a body of revolution about z."""
    radius, wall = rng.uniform(0.055, 0.14), rng.uniform(0.002, 0.006)
    height, foot = radius * rng.uniform(0.42, 0.95), rng.uniform(0.3, 0.6)
    power, steps = rng.uniform(1.3, 3.0), np.linspace(0, 1, 12)
    reach = foot + (1 - foot) * np.sin(steps * np.pi / 2) ** rng.uniform(0.7, 1.2)
    outside = np.stack([reach * radius, 0.006 + (height - 0.006) * steps**power], -1)
    inside = outside - [wall, 0.0] + [0.0, wall] * (1 - steps[:, None])
    base = [(foot * radius * 0.95, 0.0), (0.001, 0.0)]
    outer, inner = _crockery(rng)
    centre = [(0.001, inside[0, 1])]
    mesh = merge(
        [
            revolve(np.concatenate([outside[::-1], base]), outer, 36),
            revolve(np.concatenate([centre, inside, outside[-1:]]), inner, 36),
        ]
    )
    return ObjectModel("bowl", mesh, revolution("z", np.array([0, 0, height / 2])), rests=(turn("x", 180.0),))


def _crockery(rng: Random) -> tuple[Material, Material]:
    """The outside and the inside of a bowl: glazed, striped, wooden or of metal."""
    kind = rng.integers(5)
    specular, gloss = rng.uniform(0.1, 0.45), int(rng.integers(4, 7))
    if kind == 0:
        both = Material(texture.wood(rng), specular=0.05)
        return both, both
    if kind == 1:
        both = _metal(rng)
        return both, both
    plain = texture.grey(rng, 0.75, 1.0) if rng.random() < 0.5 else texture.muted(rng)
    outer = texture.stripes(rng) if kind == 2 else texture.speckled(rng, plain, 0.03)
    inner = texture.speckled(rng, plain if rng.random() < 0.5 else texture.grey(rng, 0.8, 1.0), 0.03)
    return Material(outer, specular, gloss), Material(inner, specular, gloss)


def flashlight(rng: Random) -> ObjectModel:
    """A torch that lies along x with its lens at +x: a body of revolution about its own axis, but for the button."""
    length, handle = rng.uniform(0.11, 0.27), rng.uniform(0.011, 0.02)
    head, neck = handle * rng.uniform(1.15, 1.9), rng.uniform(0.55, 0.75)
    head_length = rng.uniform(0.12, 0.25)
    body = _plastic(rng, texture.grey(rng, 0.03, 0.25)) if rng.random() < 0.5 else _plastic(rng, texture.vivid(rng))
    body = _metal(rng) if rng.random() < 0.3 else body
    trim = _plastic(rng, texture.grey(rng, 0.03, 0.5)) if rng.random() < 0.6 else body
    grip = Material(_knurl(rng, body), specular=body.specular, gloss=body.gloss)
    tail = revolve(np.array([(handle * 1.02, 0.12), (handle * 1.02, 0.01), (handle * 0.85, 0), (0.001, 0)]), trim, 28)
    tail = tail.scaled(1, 1, length)
    shaft = revolve(np.array([(handle, neck), (handle, 0.12)]), grip, 28, uv=(0, 0, 4, 6)).scaled(1, 1, length)
    rim = [(head * 0.86, 0.985), (head * 0.9, 1.0), (head, 0.995), (head, 1 - head_length * 0.6), (handle, neck)]
    front = revolve(np.array(rim), trim, 28).scaled(1, 1, length)
    lens = disc(
        head * 0.87, Material(_lens(rng), specular=0.5, gloss=6, emission=float(rng.choice([0, 0.6]))), length * 0.98
    )
    button = cushion((0.006, handle * 0.7, handle), _plastic(rng)).moved(-handle, 0, 0.4 * length)
    mesh = merge([tail, shaft, front, lens, button]).moved(z=-length / 2).placed(turn("y", 90.0)).moved(z=head)
    return ObjectModel("flashlight", mesh, revolution("x", np.array([0, 0, head])), rests=(turn("y", 90.0),))


def _knurl(rng: Random, body: Material) -> Array:
    """The grip of a handle: the body's colour with grooves around, along or across."""
    size = 64
    picture = np.resize(body.texture[:64, :64], (size, size, 3)).astype(np.float32)
    i, j = np.mgrid[0:size, 0:size]
    pattern = (np.sin(i * np.pi / 4), np.sin(j * np.pi / 4), np.sin((i + j) * np.pi / 4) * np.sin((i - j) * np.pi / 4))
    depth = rng.uniform(0, 0.5)
    return np.clip(picture * (1 - depth * (pattern[int(rng.integers(3))] > 0.2))[..., None], 0, 255).astype(np.uint8)


def _lens(rng: Random) -> Array:
    """A reflector with a bulb behind glass."""
    i, j = np.mgrid[-1:1:64j, -1:1:64j]
    radius = np.hypot(i, j)
    glow = 0.55 + 0.35 * np.sin(radius * rng.uniform(6, 14)) + (radius < 0.25) * 0.4
    return np.clip(255 * glow[..., None] * np.array([1.0, 0.98, rng.uniform(0.7, 1.0)]), 0, 255).astype(np.uint8)


def cap(rng: Random) -> ObjectModel:
    """A baseball cap that lies on its opening, brim to +x. No symmetry."""
    length, width = rng.uniform(0.088, 0.105), rng.uniform(0.075, 0.09)
    height, fullness = rng.uniform(0.095, 0.14), rng.uniform(0.65, 1.0)
    cloth, second = texture.muted(rng), texture.muted(rng)
    if rng.random() < 0.4:
        cloth = texture.vivid(rng)
    second = cloth if rng.random() < 0.6 else second
    panels = Material(_cap_panels(rng, cloth, second), specular=0.0)
    plain = Material(
        texture.fabric(rng, second, 64) if rng.random() < 0.2 else texture.speckled(rng, second, 0.08), 0.0
    )
    elevation = np.linspace(np.pi / 2, 0, 10)[:, None]
    around = np.linspace(np.pi, 3 * np.pi, 36, endpoint=False)[None]
    ring = np.cos(elevation) ** fullness
    front = 1 + 0.06 * np.cos(around) * np.sin(elevation)
    dome = np.stack(
        np.broadcast_arrays(
            length * ring * np.cos(around) * front, width * ring * np.sin(around), height * np.sin(elevation)
        ),
        -1,
    )
    parts = [sheet(dome, panels, closed=True).two_sided(), _brim(rng, length, width, plain)]
    parts.append(cushion((0.014, 0.014, 0.008), plain, 2.5).moved(z=height - 0.003))
    return ObjectModel("cap", merge(parts).moved(x=-0.03), Symmetry(centre=np.array([0, 0, height / 2])))


def _brim(rng: Random, length: float, width: float, cloth: Material) -> Mesh:
    """The brim in front of a cap's dome (length, width), curved down at its sides."""
    reach, spread, droop = rng.uniform(0.055, 0.08), rng.uniform(1.0, 1.25), rng.uniform(0.0, 0.03)
    across, out = np.linspace(-1, 1, 17)[:, None], np.linspace(-0.1, 1, 6)[None]
    angle = across * spread
    x = length * np.cos(angle) + out * reach * np.sqrt(np.clip(1 - across**4, 0, 1))
    y = width * np.sin(angle) * (1 + 0.05 * out)
    z = 0.012 + droop * (1 - across**2) * (0.6 + 0.4 * out) - 0.006 * out
    top = sheet(np.stack(np.broadcast_arrays(x, y, z), -1)[::-1], cloth, uv=(0, 0, 1, 1))
    return top.two_sided()


def _cap_panels(rng: Random, cloth: texture.Colour, front: texture.Colour, size: int = 256) -> Array:
    """The cloth of a cap's dome, once around from the back: six panels with seams, eyelets and a mark in front."""
    picture = texture.filled(cloth, size)
    middle = size // 2
    picture[:, middle - size // 6 : middle + size // 6] = front
    picture = texture.with_noise(picture, rng, 0.08, 12)
    for k in range(6):
        seam = int((k + 0.5) * size / 6) % size
        picture[:, seam : seam + 2] = picture[:, seam : seam + 2] * 0.55
        picture[size // 4 : size // 4 + 5, (seam + size // 12) % size - 3 : (seam + size // 12) % size + 2] = 20
    if rng.random() < 0.75:
        mark = np.ascontiguousarray(picture[int(size * 0.45) : int(size * 0.9), middle - 26 : middle + 26])
        ink = texture.contrasting(rng, front) if rng.random() < 0.7 else texture.vivid(rng)
        if rng.random() < 0.4:
            mark[8:-8, 4:-4] = texture.vivid(rng)
        text = texture.words(rng, 1)[: int(rng.integers(1, 5))]
        texture.write_across(mark, text, (4, 16, 48, mark.shape[0] - 16), ink, rng)
        picture[int(size * 0.45) : int(size * 0.9), middle - 26 : middle + 26] = mark
    return picture


def keyboard(rng: Random) -> ObjectModel:
    """A computer keyboard, its space bar towards -y. No symmetry."""
    pitch, rows = rng.uniform(0.0175, 0.0195), int(rng.choice([5, 6, 6]))
    columns = float(rng.choice([15, 18.5, 22.5]))
    margin, deck = rng.uniform(0.003, 0.014), rng.uniform(0.006, 0.02)
    size = np.array([columns * pitch + 2 * margin, rows * pitch + 2 * margin + rng.choice([0, 0.02]), deck])
    dark = rng.random() < 0.6
    body_colour = texture.grey(rng, 0.03, 0.2) if dark else texture.grey(rng, 0.6, 1.0)
    same = rng.random() < 0.7
    key_colour = body_colour if same else texture.grey(rng, 0.03, 0.98)
    legends = Material(_legends(rng, key_colour), specular=0.06, gloss=4)
    body = box(size, _plastic(rng, body_colour))
    mesh = merge([body, _keys(_key_places(rows, columns), pitch, size, margin, legends)])
    slope = rng.uniform(0, 0.14)
    lift = (mesh.vertices[:, 1:2] + size[1] / 2) * slope * (mesh.vertices[:, 2:] > 1e-4)
    mesh.vertices[:, 2:] += lift
    return ObjectModel("keyboard", mesh, Symmetry(centre=np.array([0, 0, deck / 2])))


def _key_places(rows: int, columns: float) -> list[tuple[float, int, float]]:
    """(left column, row from the space bar, width) of every key, in key pitches."""
    places: list[tuple[float, int, float]] = []
    bottom = [(0.0, 1.25), (1.25, 1.25), (2.5, 1.25), (3.75, 6.25), (10.0, 1.25), (11.25, 1.25), (12.5, 2.5)]
    places += [(left, 0, wide) for left, wide in bottom]
    for row in range(1, rows):
        indent = (0.0, 2.25, 1.75, 1.5, 1.0, 1.0)[row]
        places.append((0.0, row, indent))
        last = indent + int(14 - indent)
        places += [(left, row, 1.0) for left in np.arange(indent, last, 1.0)]
        places.append((last, row, 15.0 - last))
    for first, wide in ((15.25, 3), (18.5, 4)):
        if columns >= first + wide:
            places += [(first + k, row, 1.0) for row in range(rows) for k in range(wide) if (wide, row) != (3, 2)]
    return places


def _keys(places: list[tuple[float, int, float]], pitch: float, size: Array, margin: float, legends: Material) -> Mesh:
    """All keys on a deck of ``size``: each a frustum without a bottom, with one of 16 x 16 legends on top."""
    left, row, wide = np.array(places).T
    sizes = np.stack([(wide - 0.14) * pitch, np.full_like(wide, 0.86 * pitch), np.full_like(wide, 0.004)], -1)
    x = -size[0] / 2 + margin + (left + wide / 2) * pitch
    y = -size[1] / 2 + margin + (row + 0.5) * pitch
    u, v = (left * 2.7 // 1 % 16) / 16, ((row * 3 + left // 5) % 16) / 16
    blank = np.broadcast_to([0.01, 0.01, 0.03, 0.03], (len(places), 4, 4))
    rects = np.concatenate([blank, np.stack([u, v, u + 1 / 16, v + 1 / 16], -1)[:, None]], axis=1)
    return boxes(sizes, np.stack([x, y, np.full_like(x, size[2])], -1), rects, legends, taper=0.12)


def _legends(rng: Random, key: texture.Colour, size: int = 256) -> Array:
    """16 x 16 key tops with a letter or a word each; their borders are blank."""
    picture = texture.filled(key, size)
    ink, cell = texture.contrasting(rng, key), size // 16
    for k in range(256):
        x, y = (k % 16) * cell, (k // 16) * cell
        letter = chr(int(rng.integers(ord("A"), ord("Z") + 1)))
        texture.write(picture, letter, (x + 4, y + 10), 7, ink, rng)
    return picture


def monitor(rng: Random) -> ObjectModel:
    """A flat screen on a stand, facing -y, on or off. No symmetry."""
    width = rng.uniform(0.38, 0.72)
    height = width / rng.choice([16 / 9, 16 / 10, 4 / 3, 21 / 9], p=[0.5, 0.2, 0.25, 0.05])
    lift, thickness = rng.uniform(0.05, 0.16), rng.uniform(0.015, 0.05)
    bezel = rng.uniform(0.004, 0.028)
    shell = _plastic(rng, texture.grey(rng, 0.02, 0.2) if rng.random() < 0.7 else texture.grey(rng, 0.5, 0.95))
    parts = [
        box((width, thickness, height), shell).moved(z=lift),
        _glass(rng, width, height, bezel).moved(0, -thickness / 2, lift),
    ]
    if rng.random() < 0.6:
        parts.append(
            box((width * 0.6, 0.04, height * 0.6), shell, taper=0.1).moved(0, thickness / 2 + 0.01, lift + height * 0.2)
        )
    parts += _stand(rng, width, lift + height * 0.5, thickness, shell)
    centre = np.array([0, 0, (lift + height) / 2])
    return ObjectModel("monitor", merge(parts), Symmetry(centre=centre))


def _glass(rng: Random, width: float, height: float, bezel: float) -> Mesh:
    """The screen of a monitor, just in front of its shell."""
    loss = float(rng.choice([0.0, 0.3, 0.7], p=[0.4, 0.4, 0.2]))
    if rng.random() < 0.6:
        pane = Material(
            print_design.screen(rng), specular=0.1, gloss=6, emission=rng.uniform(0.5, 1.0), depth_loss=loss
        )
    else:
        pane = Material(
            texture.speckled(rng, texture.grey(rng, 0.02, 0.09), 0.02), specular=0.35, gloss=6, depth_loss=loss
        )
    chin = bezel * rng.choice([1.0, 2.0])
    x, low, high = width / 2 - bezel, chin, height - bezel
    corners = np.array([[(-x, 0, high), (x, 0, high)], [(-x, 0, low), (x, 0, low)]])
    return sheet(corners + np.array([0, -0.001, 0]), pane)


def _stand(rng: Random, width: float, top: float, thickness: float, shell: Material) -> list[Mesh]:
    """A neck behind the panel and a foot: a plate, a disc or two legs."""
    kind, back = rng.integers(3), thickness / 2 + 0.015
    if kind == 2:
        feet = []
        for x in (-0.3 * width, 0.3 * width):
            path = np.array([(x, -0.1, 0.008), (x, 0.0, 0.03), (x, 0.1, 0.008)])
            feet += [tube(path, 0.008, shell, 8), box((0.03, 0.02, top), shell).moved(x=x)]
        return feet
    neck = box((rng.uniform(0.03, 0.12), rng.uniform(0.015, 0.04), top), shell).moved(y=back)
    spread, depth = width * rng.uniform(0.35, 0.6), rng.uniform(0.14, 0.24)
    if kind == 0:
        return [neck, box((spread, depth, rng.uniform(0.006, 0.02)), shell).moved(y=back - 0.03)]
    plate = revolve(np.array([(0.001, 0.012), (0.5, 0.012), (0.5, 0.0)]), shell).scaled(spread, depth, 1.0)
    return [neck, plate.moved(y=back - 0.03)]


LABELS = ("cap", "cereal_box", "soda_can", "chair", "monitor", "bowl", "flashlight", "book", "keyboard")

FAMILIES: dict[str, Callable[[Random], ObjectModel]] = {
    family.__name__: family for family in (cap, cereal_box, soda_can, chair, monitor, bowl, flashlight, book, keyboard)
}


def make_object(label: str, seed: int) -> ObjectModel:
    """The instance number ``seed`` of a class; the same seed gives the same size, shape and print.

    ValueError if there is no such class.
    """
    if label not in FAMILIES:
        raise ValueError(f"expected one of {', '.join(LABELS)}, got {label!r}")
    return FAMILIES[label](np.random.default_rng([LABELS.index(label), seed]))
