# SPDX-License-Identifier: Apache-2.0
"""Procedural textures: plain and natural surfaces, as (S, S, 3) uint8 sRGB pictures drawn from a random generator."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

from objreg_ros.data.checked import Array

Colour = tuple[int, int, int]


def hsv(hue: float, saturation: float, value: float) -> Colour:
    """The sRGB colour 0..255 of hue, saturation and value in 0..1; the hue wraps."""
    r, g, b = (round(255 * part) for part in colorsys.hsv_to_rgb(hue % 1.0, saturation, value))
    return r, g, b


def vivid(rng: np.random.Generator) -> Colour:
    """A saturated colour, as printed on packages."""
    return hsv(rng.random(), rng.uniform(0.6, 1.0), rng.uniform(0.5, 1.0))


def muted(rng: np.random.Generator) -> Colour:
    """A colour of paint, cloth or plastic: any hue, mostly weak."""
    return hsv(rng.random(), rng.beta(1.0, 2.8), rng.uniform(0.12, 0.95))


def grey(rng: np.random.Generator, low: float = 0.05, high: float = 0.95) -> Colour:
    """A nearly neutral colour of brightness low..high."""
    return hsv(rng.random(), rng.uniform(0, 0.08), rng.uniform(low, high))


def pastel(rng: np.random.Generator) -> Colour:
    """A light wall colour."""
    return hsv(rng.uniform(0, 1), rng.beta(1.0, 4.0) * 0.6, rng.uniform(0.55, 0.98))


def contrasting(rng: np.random.Generator, background: Colour) -> Colour:
    """A colour that stands out from ``background``."""
    bright = sum(background) / 3 > 128
    value = rng.uniform(0.0, 0.35) if bright else rng.uniform(0.85, 1.0)
    return hsv(rng.random(), rng.choice([0.0, 0.9]) * rng.uniform(0.5, 1), value)


def filled(colour: Colour, size: int = 64) -> Array:
    """A plain picture."""
    return np.full((size, size, 3), colour, np.uint8)


def noise(rng: np.random.Generator, size: int, cells: int, octaves: int = 3) -> Array:
    """(S, S) float32 value noise of mean 0 and about unit range that repeats at the borders."""
    total = np.zeros((size, size), np.float32)
    for octave in range(octaves):
        n = min(cells * 2**octave, size)
        coarse = np.pad(rng.uniform(-1, 1, (n, n)).astype(np.float32), 2, mode="wrap")
        scale = size / n
        fine = cv2.resize(coarse, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        offset = int(2 * scale)
        total += fine[offset : offset + size, offset : offset + size] * 0.55**octave
    return total


def with_noise(picture: Array, rng: np.random.Generator, strength: float, cells: int = 8) -> Array:
    """The picture with its brightness modulated by ``strength`` 0..1 of value noise."""
    factor = 1.0 + strength * noise(rng, picture.shape[0], cells)
    return np.clip(picture * factor[..., None], 0, 255).astype(np.uint8)


def speckled(rng: np.random.Generator, colour: Colour, strength: float = 0.15, size: int = 128) -> Array:
    """Fine grain: paint, plastic, carpet, concrete, by ``strength``."""
    picture = with_noise(filled(colour, size), rng, strength * 0.6, 4)
    grain = 1.0 + strength * rng.standard_normal((size, size, 1), dtype=np.float32)
    return np.clip(picture * grain, 0, 255).astype(np.uint8)


def mixed(low: Colour, high: Colour, share: Array) -> Array:
    """The picture between two colours by a (S, S) share 0..1."""
    part = np.clip(share, 0, 1)[..., None]
    return (np.array(low) * (1 - part) + np.array(high) * part).astype(np.uint8)


def wood(rng: np.random.Generator, size: int = 256) -> Array:
    """Grain along the rows, from pale maple to dark walnut, sometimes in planks."""
    hue, value = rng.uniform(0.04, 0.12), rng.uniform(0.25, 0.9)
    light = hsv(hue, rng.uniform(0.25, 0.65), value)
    dark = hsv(hue - 0.01, rng.uniform(0.4, 0.75), value * rng.uniform(0.5, 0.85))
    knots = noise(rng, size, 2) * rng.uniform(0.5, 5)
    stretched = cv2.resize(noise(rng, size, 6)[:, : size // 8], (size, size), interpolation=cv2.INTER_CUBIC)
    rings = 2 * np.pi * round(rng.uniform(2, 9)) * np.arange(size)[:, None] / size
    warp = knots * rng.random() ** 2 + 2.5 * stretched + rings
    fibres = cv2.resize(rng.uniform(-1, 1, (size, 8)).astype(np.float32), (size, size))
    picture = mixed(light, dark, 0.5 + 0.32 * np.sin(warp) + 0.22 * fibres)
    return planks(rng, picture) if rng.random() < 0.35 else picture


def planks(rng: np.random.Generator, picture: Array) -> Array:
    """The picture cut into boards of different brightness with dark joints."""
    size, count = picture.shape[0], int(rng.choice([2, 4, 8]))
    board = size // count
    out = picture.astype(np.float32)
    for k in range(count):
        out[k * board : (k + 1) * board] *= rng.uniform(0.8, 1.15)
        out[k * board : k * board + 2] *= 0.5
        out[k * board : (k + 1) * board, int(rng.integers(size))] *= 0.5
    return np.clip(out, 0, 255).astype(np.uint8)


def tiles(rng: np.random.Generator, size: int = 256) -> Array:
    """Square tiles with joints."""
    count = int(rng.choice([2, 4, 8]))
    picture = np.kron(rng.uniform(0.9, 1.1, (count, count, 1)), np.ones((size // count, size // count, 1)))
    picture = np.clip(picture * muted(rng), 0, 255)
    width, joint = int(rng.integers(1, 4)), grey(rng, 0.2, 0.9)
    for k in range(count):
        at = k * size // count
        picture[at : at + width] = joint
        picture[:, at : at + width] = joint
    return with_noise(picture.astype(np.uint8), rng, 0.1, 16)


def fabric(rng: np.random.Generator, colour: Colour | None = None, size: int = 128) -> Array:
    """Woven cloth: a plain colour, checks or stripes, with threads."""
    picture = filled(colour or muted(rng), size).astype(np.float32)
    kind = rng.integers(4)
    if kind < 2:
        period, share = size // int(rng.choice([2, 4, 8])), rng.uniform(0.3, 0.6)
        stripes = (np.arange(size) % period) < share * period
        mask = stripes[:, None] & (stripes[None] if kind else np.ones(size, bool))
        picture[mask] = muted(rng)
    thread = 1 + 0.1 * np.sin(np.arange(size) * np.pi / 2)
    return np.clip(picture * thread[:, None, None] * thread[None, :, None], 0, 255).astype(np.uint8)


def marble(rng: np.random.Generator, size: int = 256) -> Array:
    """Stone with veins."""
    veins = 1 - np.abs(np.sin(3 * noise(rng, size, 3, 5) * rng.uniform(1, 3)))
    return mixed(muted(rng), grey(rng), 0.15 + 0.7 * veins**3)


def brushed(rng: np.random.Generator, size: int = 128) -> Array:
    """Metal with fine parallel scratches along the rows."""
    lines = cv2.resize(rng.uniform(-1, 1, (size, 4)).astype(np.float32), (size, size))
    shade = 1 + 0.12 * lines[..., None] + 0.08 * noise(rng, size, 3)[..., None]
    return np.clip(filled(grey(rng, 0.4, 0.85), size) * shade, 0, 255).astype(np.uint8)


def patches(rng: np.random.Generator, size: int = 128) -> Array:
    """A wild pattern of coloured shapes: no object of interest is recognised by it."""
    picture = filled(vivid(rng) if rng.random() < 0.5 else muted(rng), size)
    for _ in range(int(rng.integers(2, 18))):
        colour = vivid(rng) if rng.random() < 0.6 else grey(rng)
        centre = (int(rng.integers(size)), int(rng.integers(size)))
        reach = int(rng.integers(3, size // 2))
        kind = rng.integers(4)
        if kind == 0:
            cv2.circle(picture, centre, reach // 2, colour, -1, cv2.LINE_AA)
        elif kind == 1:
            corner = (centre[0] + reach, centre[1] + int(rng.integers(3, size // 2)))
            cv2.rectangle(picture, centre, corner, colour, -1)
        elif kind == 2:
            cv2.line(picture, centre, tuple(int(v) for v in rng.integers(0, size, 2)), colour, 1 + reach // 8)
        else:
            write(picture, words(rng, 1), centre, reach / 2, colour, rng)
    return picture


def stripes(rng: np.random.Generator, size: int = 128, rows: bool = True) -> Array:
    """Bands of a few colours across the rows (or the columns)."""
    colours = np.array([vivid(rng) if rng.random() < 0.5 else grey(rng) for _ in range(int(rng.integers(2, 6)))])
    edges = np.sort(rng.uniform(0, 1, len(colours) - 1))
    bands = colours[np.searchsorted(edges, np.arange(size) / size)]
    picture = np.repeat(bands[:, None], size, axis=1) if rows else np.repeat(bands[None], size, axis=0)
    return np.ascontiguousarray(picture.astype(np.uint8))


def any_surface(rng: np.random.Generator) -> Array:
    """Some texture of any kind."""
    kinds = (wood, marble, fabric, patches, stripes, tiles, brushed)
    if rng.random() < 0.35:
        return speckled(rng, muted(rng), rng.uniform(0, 0.2))
    return kinds[int(rng.integers(len(kinds)))](rng)


SYLLABLES = (
    "ba be bi co da do el fa fi ga go ha in ka ki la lo ma mi mo na ne no o pa pi ra ri ro sa so ta ti to u vi zo"
)
FONTS = (
    cv2.FONT_HERSHEY_SIMPLEX,
    cv2.FONT_HERSHEY_DUPLEX,
    cv2.FONT_HERSHEY_COMPLEX,
    cv2.FONT_HERSHEY_TRIPLEX,
    cv2.FONT_HERSHEY_SCRIPT_SIMPLEX,
)


def words(rng: np.random.Generator, count: int) -> str:
    """Invented words; no brand of this world."""
    syllables = SYLLABLES.split()
    made = ["".join(rng.choice(syllables, int(rng.integers(2, 4)))) for _ in range(count)]
    return " ".join(word.upper() if rng.random() < 0.5 else word.capitalize() for word in made)


def write(
    picture: Array, text: str, origin: tuple[int, int], height: float, colour: Colour, rng: np.random.Generator
) -> None:
    """Write ``text`` in letters of ``height`` px; ``origin`` (x, y) is its lower left corner."""
    font = FONTS[int(rng.integers(len(FONTS)))]
    thickness = max(1, int(height * rng.uniform(0.06, 0.22)))
    cv2.putText(picture, text, origin, font, height / 22, colour, thickness, cv2.LINE_AA)


def write_across(
    picture: Array, text: str, box: tuple[int, int, int, int], colour: Colour, rng: np.random.Generator
) -> None:
    """Write ``text`` as large as it fits the box (x0, y0, x1, y1), centred."""
    x0, y0, x1, y1 = box
    font = FONTS[int(rng.integers(len(FONTS)))]
    (width, height), _ = cv2.getTextSize(text, font, 1.0, 2)
    scale = min((x1 - x0) / max(width, 1), (y1 - y0) / max(height, 1))
    thickness = max(1, round(scale * rng.uniform(1.5, 5)))
    origin = (int((x0 + x1 - width * scale) / 2), int((y0 + y1 + height * scale) / 2))
    cv2.putText(picture, text, origin, font, scale, colour, thickness, cv2.LINE_AA)


def text_lines(
    picture: Array, box: tuple[int, int, int, int], colour: Colour, rng: np.random.Generator, height: int = 4
) -> None:
    """Fill the box (x0, y0, x1, y1) with lines of small print, as short dashes."""
    x0, y0, x1, y1 = box
    for y in range(y0 + 1, y1 - 1, height):
        x, end = x0, x0 + int((x1 - x0) * rng.uniform(0.5, 1.0))
        while x < end:
            length = int(rng.integers(2, 3 + height * 2))
            cv2.line(picture, (x, y), (min(x + length, end), y), colour, max(1, height // 3))
            x += length + max(2, height // 2)
