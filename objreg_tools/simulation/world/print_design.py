# SPDX-License-Identifier: Apache-2.0
"""Prints on things: cereal boxes, cans, book covers, keys, screens, posters; drawn from a random generator."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.world.texture import (
    Colour,
    contrasting,
    filled,
    grey,
    hsv,
    mixed,
    muted,
    noise,
    pastel,
    patches,
    stripes,
    text_lines,
    vivid,
    with_noise,
    words,
    write_across,
)

Random = np.random.Generator


def gradient(rng: Random, low: Colour, high: Colour, size: int = 256) -> Array:
    """A smooth change between two colours in a random direction."""
    angle = rng.uniform(0, 2 * np.pi)
    x = np.linspace(-0.5, 0.5, size)
    return mixed(low, high, 0.5 + x[None] * np.cos(angle) + x[:, None] * np.sin(angle))


def picture(rng: Random, size: int = 128) -> Array:
    """Something like a photograph or a painting: sky and land, blobs, or patches."""
    kind = rng.integers(3)
    if kind == 0:
        return patches(rng, size)
    image = gradient(rng, vivid(rng) if kind == 1 else muted(rng), muted(rng), size)
    horizon = int(size * rng.uniform(0.3, 0.8))
    if kind == 1:
        image[horizon:] = mixed(muted(rng), vivid(rng), 0.5 + 0.5 * noise(rng, size, 4))[horizon:]
    for _ in range(int(rng.integers(2, 9))):
        centre = (int(rng.integers(size)), int(rng.integers(size)))
        axes = (int(rng.integers(size // 20, size // 4)), int(rng.integers(size // 20, size // 4)))
        cv2.ellipse(image, centre, axes, float(rng.uniform(0, 180)), 0, 360, muted(rng), -1, cv2.LINE_AA)
    return with_noise(image, rng, 0.25, 6)


def _paste(target: Array, source: Array, box: tuple[int, int, int, int]) -> None:
    x0, y0, x1, y1 = box
    target[y0:y1, x0:x1] = cv2.resize(source, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)


def _breakfast_bowl(image: Array, centre: tuple[int, int], radius: int, rng: Random) -> None:
    """A bowl full of loops and flakes, seen from the side."""
    x, y = centre
    cv2.ellipse(image, (x, y), (radius, radius), 0, 0, 180, vivid(rng), -1, cv2.LINE_AA)
    cv2.ellipse(image, (x, y), (radius, radius // 3), 0, 0, 360, (250, 248, 240), -1, cv2.LINE_AA)
    several, base = rng.random() < 0.4, hsv(rng.uniform(0.06, 0.13), 0.75, rng.uniform(0.5, 0.9))
    for _ in range(int(rng.integers(20, 60))):
        angle, reach = rng.uniform(0, 2 * np.pi), np.sqrt(rng.random()) * 0.9
        at = (int(x + radius * reach * np.cos(angle)), int(y + radius / 3 * reach * np.sin(angle) - rng.uniform(0, 6)))
        colour = vivid(rng) if several else tuple(int(c * rng.uniform(0.75, 1.1)) for c in base)
        cv2.circle(image, at, max(2, radius // 9), colour, int(rng.choice([-1, 2])), cv2.LINE_AA)


def _mascot(image: Array, centre: tuple[int, int], radius: int, rng: Random) -> None:
    """A round face with ears, eyes and a grin."""
    x, y = centre
    skin = vivid(rng)
    for side in (-1, 1):
        cv2.circle(image, (x + side * int(radius * 0.75), y - int(radius * 0.75)), radius // 3, skin, -1, cv2.LINE_AA)
    cv2.circle(image, (x, y), radius, skin, -1, cv2.LINE_AA)
    for side in (-1, 1):
        eye = (x + side * radius // 3, y - radius // 4)
        cv2.circle(image, eye, max(2, radius // 4), (255, 255, 255), -1, cv2.LINE_AA)
        cv2.circle(image, eye, max(1, radius // 8), (10, 10, 10), -1, cv2.LINE_AA)
    cv2.ellipse(image, (x, y + radius // 4), (radius // 2, radius // 3), 0, 0, 180, (120, 20, 20), -1, cv2.LINE_AA)


def _burst(image: Array, centre: tuple[int, int], radius: int, colour: Colour, points: int = 12) -> None:
    """A star behind a slogan."""
    angle = np.arange(2 * points) * np.pi / points
    reach = np.where(np.arange(2 * points) % 2, 0.7, 1.0) * radius
    corners = np.stack([centre[0] + reach * np.cos(angle), centre[1] + reach * np.sin(angle)], -1)
    cv2.fillPoly(image, [corners.astype(np.int32)], colour, cv2.LINE_AA)


def _package_ground(rng: Random, base: Colour, size: int) -> Array:
    """The background of a package's front: plain, a gradient, rays or a wave."""
    kind, other = rng.integers(4), vivid(rng) if rng.random() < 0.6 else (250, 250, 245)
    if kind == 0:
        return filled(base, size)
    if kind == 1:
        return gradient(rng, base, other, size)
    image = filled(base, size)
    if kind == 2:
        centre = (size // 2, int(size * rng.uniform(0.3, 0.8)))
        for start in range(0, 360, 30):
            cv2.ellipse(image, centre, (2 * size, 2 * size), 0, start, start + 15, other, -1)
        return image
    x = np.arange(size)
    edge = size * rng.uniform(0.35, 0.75) + size * 0.12 * np.sin(x / size * rng.uniform(2, 8) + rng.uniform(0, 6))
    image[np.arange(size)[:, None] > edge[None]] = other
    return image


def _colour_at(image: Array, row: int, column: int) -> Colour:
    r, g, b = (int(v) for v in image[row, column])
    return r, g, b


def package_front(rng: Random, base: Colour, brand: str, size: int = 256) -> Array:
    """The front of a cereal box: a big name, a bowl or a mascot, a burst, small print."""
    image = _package_ground(rng, base, size)
    top = int(size * rng.uniform(0.03, 0.15))
    height = int(size * rng.uniform(0.13, 0.28))
    ink = contrasting(rng, _colour_at(image, top + height // 2, size // 2))
    if rng.random() < 0.5:
        band = vivid(rng)
        cv2.rectangle(image, (0, top), (size, top + height), band, -1)
        ink = contrasting(rng, band)
    write_across(image, brand, (10, top + 4, size - 10, top + height - 4), ink, rng)
    write_across(image, words(rng, 2), (40, top + height + 4, size - 40, top + height + 20), ink, rng)
    if rng.random() < 0.85:
        _breakfast_bowl(
            image, (int(size * rng.uniform(0.35, 0.65)), int(size * rng.uniform(0.62, 0.75))), size // 4, rng
        )
    if rng.random() < 0.5:
        _mascot(image, (int(size * rng.choice([0.25, 0.72])), int(size * rng.uniform(0.4, 0.55))), size // 8, rng)
    if rng.random() < 0.6:
        at = (int(size * rng.choice([0.2, 0.8])), int(size * rng.uniform(0.4, 0.9)))
        _burst(image, at, size // 8, vivid(rng))
    text_lines(image, (8, int(size * 0.93), size - 60, size - 4), contrasting(rng, base), rng)
    return image


def package_side(rng: Random, base: Colour, brand: str, size: int = 256) -> Array:
    """The narrow side of a package: the name, a table of contents, a barcode."""
    image = filled(base, size)
    ink = contrasting(rng, base)
    write_across(image, brand, (20, 10, size - 20, 50), ink, rng)
    top = int(rng.integers(60, 120))
    cv2.rectangle(image, (20, top), (size - 20, size - 50), (248, 248, 245), -1)
    text_lines(image, (28, top + 6, size - 28, size - 56), (20, 20, 20), rng, 7)
    barcode(image, (60, size - 42, size - 60, size - 8), rng)
    return image


def barcode(image: Array, box: tuple[int, int, int, int], rng: Random) -> None:
    """Draw a barcode into the box (x0, y0, x1, y1)."""
    x0, y0, x1, y1 = box
    bars = np.repeat(rng.random(x1 - x0) < 0.5, 2)[: x1 - x0]
    image[y0:y1, x0:x1] = np.where(bars[None, :, None], 15, 250)


def cereal_box(rng: Random) -> Array:
    """(512, 512, 3): front in the left half's top, back below it, and the sides in the right half."""
    sheet = np.zeros((512, 512, 3), np.uint8)
    base, brand = vivid(rng), words(rng, int(rng.integers(1, 3)))
    sheet[:256, :256] = package_front(rng, base, brand)
    sheet[256:, :256] = sheet[:256, :256] if rng.random() < 0.5 else package_front(rng, base, brand)
    sheet[:256, 256:] = package_side(rng, base, brand)
    sheet[256:, 256:] = filled(base, 256)
    write_across(sheet, brand, (276, 330, 492, 430), contrasting(rng, base), rng)
    return sheet


CEREAL_BOX_ATLAS = {
    "front": (0.0, 0.0, 0.5, 0.5),
    "back": (0.0, 0.5, 0.5, 1.0),
    "left": (0.5, 0.0, 1.0, 0.5),
    "right": (0.5, 0.0, 1.0, 0.5),
    "top": (0.5, 0.5, 1.0, 1.0),
    "bottom": (0.5, 0.5, 1.0, 1.0),
}


def can_label(rng: Random, size: int = 256) -> Array:
    """The printed wall of a can, once around: a ground, a wave or bands, and a name twice along the circumference."""
    base = vivid(rng) if rng.random() < 0.75 else grey(rng, 0.05, 0.95)
    image = filled(base, size)
    second = vivid(rng) if rng.random() < 0.5 else grey(rng, 0.7, 1.0)
    kind = rng.integers(4)
    if kind == 0:
        x, y = np.arange(size)[None], np.arange(size)[:, None]
        wave = size * rng.uniform(0.3, 0.7) + size * 0.15 * np.sin(x / size * 4 * np.pi)
        image[np.abs(y - wave) < size * rng.uniform(0.03, 0.15)] = second
    elif kind == 1:
        low, high = sorted(rng.uniform(0.1, 0.9, 2))
        image[int(low * size) : int(high * size)] = second
    elif kind == 2:
        image = gradient(rng, base, second, size)
    name, ink = words(rng, 1), contrasting(rng, base)
    upright = rng.random() < 0.5
    for half in (0, size // 2):
        part = np.ascontiguousarray(image[:, half : half + size // 2])
        if not upright:
            part = np.ascontiguousarray(np.rot90(part))
        height, width = part.shape[:2]
        write_across(part, name, (6, int(height * 0.25), width - 6, int(height * 0.6)), ink, rng)
        text_lines(part, (12, int(height * 0.75), width - 30, int(height * 0.92)), ink, rng, 5)
        image[:, half : half + size // 2] = part if upright else np.rot90(part, -1)
    return image


def book_cover(rng: Random) -> Array:
    """(256, 256, 3): front in the left 60 %, then spine 10 % and back 30 %."""
    base = vivid(rng) if rng.random() < 0.5 else muted(rng)
    image = filled(base, 256)
    ink, front = contrasting(rng, base), (0, 0, 154, 256)
    kind = rng.integers(4)
    if kind == 1:
        _paste(image, picture(rng), front)
    elif kind == 2:
        _paste(image, picture(rng), (12, 100, 142, 220))
    elif kind == 3:
        _paste(image, stripes(rng), front)
    top = int(rng.integers(15, 70))
    title = words(rng, int(rng.integers(1, 3)))
    if rng.random() < 0.5:
        cv2.rectangle(image, (0, top - 6), (154, top + 40), contrasting(rng, ink), -1)
    write_across(image, title, (10, top, 144, top + 34), ink, rng)
    write_across(image, words(rng, 2), (30, 228, 124, 244), ink, rng)
    spine = np.ascontiguousarray(np.rot90(image[:, 154:180]))
    write_across(spine, title, (20, 3, 200, spine.shape[0] - 3), ink, rng)
    image[:, 154:180] = np.rot90(spine, -1)
    text_lines(image, (190, 40, 246, 200), ink, rng, 6)
    return image


BOOK_FRONT, BOOK_SPINE, BOOK_BACK = (0.0, 0.0, 0.6, 1.0), (0.605, 0.0, 0.7, 1.0), (0.71, 0.0, 1.0, 1.0)


def page_edges(rng: Random, size: int = 64) -> Array:
    """The edge of a block of pages: fine lines along the columns of u."""
    tone = np.array(hsv(0.12, rng.uniform(0.02, 0.25), rng.uniform(0.8, 0.97)))
    lines = rng.uniform(0.82, 1.0, (size, 1, 1)) * np.ones((1, size, 1))
    return np.clip(lines * tone, 0, 255).astype(np.uint8)


def printed_page(rng: Random, size: int = 128) -> Array:
    """A page of text, sometimes with a picture."""
    image = filled(hsv(0.12, rng.uniform(0, 0.12), rng.uniform(0.88, 1.0)), size)
    text_lines(image, (12, 12, size - 12, size - 12), (50, 50, 50), rng, 5)
    if rng.random() < 0.4:
        top = int(rng.integers(10, 60))
        _paste(image, picture(rng), (12, top, size - 12, top + 50))
    return image


def screen(rng: Random, size: int = 256) -> Array:
    """The picture of a screen that is on: a desktop with windows, text or code, a picture or a page."""
    kind = rng.integers(4)
    image = cv2.resize(picture(rng), (size, size)) if kind != 3 else filled(grey(rng, 0.05, 1.0), size)
    if kind != 0:
        for _ in range(int(rng.integers(1, 4))):
            _window(image, rng)
    if rng.random() < 0.6:
        cv2.rectangle(image, (0, size - 10), (size, size), grey(rng), -1)
    return image


def _window(image: Array, rng: Random) -> None:
    size = image.shape[0]
    x0, y0 = (int(v) for v in rng.integers(0, size // 2, 2))
    x1, y1 = (int(v) for v in rng.integers(size // 2, size, 2))
    paper = grey(rng, 0.85, 1.0) if rng.random() < 0.65 else grey(rng, 0.02, 0.2)
    cv2.rectangle(image, (x0, y0), (x1, y1), paper, -1)
    cv2.rectangle(image, (x0, y0), (x1, min(y0 + 10, y1)), muted(rng), -1)
    text_lines(image, (x0 + 6, y0 + 14, x1 - 6, y1 - 4), contrasting(rng, paper), rng, int(rng.integers(4, 9)))


def poster(rng: Random, size: int = 256) -> Array:
    """A framed picture, a poster, a whiteboard or a notice for the wall."""
    kind = rng.integers(3)
    image = cv2.resize(picture(rng), (size, size)) if kind else filled(pastel(rng), size)
    if kind != 2:
        write_across(image, words(rng, 2), (20, 20, size - 20, 70), contrasting(rng, pastel(rng)), rng)
        text_lines(image, (30, 100, size - 30, size - 30), grey(rng, 0, 0.4), rng, 9)
    cv2.rectangle(image, (0, 0), (size - 1, size - 1), grey(rng), int(rng.integers(2, 14)))
    return image
