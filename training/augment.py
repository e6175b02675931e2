# SPDX-License-Identifier: Apache-2.0
"""What happens to a picture between the disk and the network: geometry, light, and what cameras do to pictures."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from training.priors import INPUT_HW
from training.samples import Sample

Array = NDArray[Any]
Rng = np.random.Generator
WindowIn = Callable[[Sample, tuple[int, int], Rng], Array]

LEAST_KEPT = 0.4
"""An object that a crop leaves less of becomes difficult."""

LEAST_SIDE_PX = 6.0
"""So does one that becomes smaller than this at the network's input."""

INTERPOLATIONS = (cv2.INTER_LINEAR, cv2.INTER_AREA, cv2.INTER_CUBIC, cv2.INTER_NEAREST)


MOSAIC_GRIDS, MOSAIC_ZOOM = (2, 3, 4, 4, 5), (0.55, 2.5)
"""A grid of pieces with an object each is many times as much to learn from in the same time."""

LABEL_WEIGHTS = np.array([0.9, 1.0, 1.0, 0.7, 0.5, 1.1, 2.6, 2.2, 1.1])
"""How often the pieces show each label, in the order of the labels; small and thin objects are harder to learn."""


MISTAKE_GRIDS, MISTAKE_SHARE = (3, 3, 4), (0.6, 1.0)
"""The same for mosaics of mistakes: each is shown at about its own size, by so much of its crop."""


def augment(
    pick: Callable[[], Sample], rng: Rng, mosaic_share: float = 0.5, pick_mistake: Callable[[], Sample] | None = None
) -> Sample:
    """A random picture of the network's size: a share of mosaics, the others of one sample that ``pick`` gives.

    Every other mosaic is one of mistakes, crops in whose middle something is, if there is something to pick from.
    """
    if rng.random() >= mosaic_share:
        sample = single(pick(), rng)
    elif pick_mistake is not None and rng.random() < 0.5:
        sample = mosaic(pick_mistake, rng, MISTAKE_GRIDS, window_at_the_middle)
    else:
        sample = mosaic(pick, rng)
    return with_other_light(sample, rng)


def with_other_light(sample: Sample, rng: Rng) -> Sample:
    """The same under another light and by a worse camera, now and then."""
    rgb = sample.rgb
    if rng.random() < 0.5:
        rgb = change_light(rgb, rng)
    if rng.random() < 0.4:
        rgb = degrade(rgb, rng)
    return replace(sample, rgb=rgb)


def single(sample: Sample, rng: Rng) -> Sample:
    """One sample, perhaps mirrored, and a window of it."""
    if rng.random() < 0.5:
        sample = flip(sample)
    return cut(sample, random_window(sample.rgb.shape[:2], rng), INPUT_HW, rng)


def mosaic(
    pick: Callable[[], Sample], rng: Rng, grids: Sequence[int] = MOSAIC_GRIDS, window_in: WindowIn | None = None
) -> Sample:
    """Pieces around objects, side by side in a grid (after Bochkovskiy et al., "YOLOv4", 2020)."""
    window_in = window_in or window_at_an_object
    grid = int(rng.choice(grids))
    height, width = INPUT_HW[0] // grid, INPUT_HW[1] // grid
    rgb = np.zeros((*INPUT_HW, 3), np.uint8)
    parts = []
    for x, y in itertools.product(range(0, grid * width, width), range(0, grid * height, height)):
        sample = pick()
        sample = flip(sample) if rng.random() < 0.5 else sample
        part = cut(sample, window_in(sample, (height, width), rng), (height, width), rng)
        rgb[y : y + height, x : x + width] = part.rgb
        parts.append(replace(part, boxes=part.boxes + np.array([x, y, x, y], np.float32)))
    boxes, classes, difficult = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("boxes", "classes", "difficult")
    )
    return Sample(rgb, boxes, classes, difficult)


def window_at_an_object(sample: Sample, shape: tuple[int, int], rng: Rng) -> Array:
    """A window of the aspect of ``shape`` with one of the objects and some surroundings in it, or with anything."""
    size, picture = np.array([shape[1], shape[0]], float), np.array(sample.rgb.shape[1::-1])
    wanted = np.flatnonzero(~sample.difficult)
    if len(wanted) == 0:
        low = rng.uniform(0, 1, 2) * np.maximum(picture - size, 0)
        return np.concatenate([low, low + size])
    rarity = LABEL_WEIGHTS[sample.classes[wanted]]
    box = sample.boxes[rng.choice(wanted, p=rarity / rarity.sum())]
    fill = float(((box[2:] - box[:2]) / size).max())
    size = size * max(1.05 * fill, np.clip(fill * rng.uniform(1.1, 2.4), *MOSAIC_ZOOM))
    low = box[:2] - rng.uniform(0, 1, 2) * (size - (box[2:] - box[:2]))
    low = np.clip(low, 0, np.maximum(picture - size, 0))
    return np.concatenate([low, low + size])


def window_at_the_middle(sample: Sample, shape: tuple[int, int], rng: Rng) -> Array:
    """A window of the aspect of ``shape`` around the middle of the picture."""
    whole = np.array(sample.rgb.shape[1::-1], float)
    size = np.array([shape[1], shape[0]], float)
    size *= float((whole / size).min()) * rng.uniform(*MISTAKE_SHARE)
    low = (whole - size) / 2 + rng.uniform(-0.15, 0.15, 2) * size
    low = np.clip(low, 0, whole - size)
    return np.concatenate([low, low + size])


def flip(sample: Sample) -> Sample:
    """The mirror image."""
    width = sample.rgb.shape[1]
    boxes = sample.boxes.copy()
    boxes[:, [0, 2]] = width - sample.boxes[:, [2, 0]]
    return replace(sample, rgb=cv2.flip(sample.rgb, 1), boxes=boxes)


def random_window(shape: tuple[int, int], rng: Rng) -> Array:
    """A window x_min y_min x_max y_max in pixels: the whole picture, a part of it, or more than it."""
    height, width = shape
    kind = rng.random()
    if kind < 0.55:
        return np.array([0, 0, width, height], float)
    share = rng.uniform(0.6, 1.0) if kind < 0.85 else rng.uniform(1.0, 1.6)
    aspect = np.exp(rng.uniform(-0.25, 0.25))
    size = np.array([width * share * aspect**0.5, height * share / aspect**0.5])
    low = rng.uniform(0, 1, 2) * (np.array([width, height]) - size)
    return np.concatenate([low, low + size])


def cut(sample: Sample, window: Array, shape: tuple[int, int], rng: Rng) -> Sample:
    """The window of the picture at the size ``shape``; what is outside is filled with something meaningless."""
    out_height, out_width = shape
    size = window[2:] - window[:2]
    scale = np.array([out_width, out_height]) / size
    shift = -window[:2] * scale
    M = np.array([[scale[0], 0, shift[0] + (scale[0] - 1) / 2], [0, scale[1], shift[1] + (scale[1] - 1) / 2]])
    if np.array_equal(scale, (1, 1)) and not shift.any():
        rgb = sample.rgb
    else:
        rgb = background((out_height, out_width), rng)
        how = int(rng.choice(INTERPOLATIONS[:3:2] if rng.random() < 0.9 else INTERPOLATIONS[3:]))
        source = cv2.blur(sample.rgb, (2, 2)) if scale.max() < 0.75 else sample.rgb
        cv2.warpAffine(source, M, (out_width, out_height), dst=rgb, flags=how, borderMode=cv2.BORDER_TRANSPARENT)
    return _boxes_in(replace(sample, rgb=rgb), scale, shift)


def _boxes_in(sample: Sample, scale: Array, shift: Array) -> Sample:
    """The boxes after the cut; objects that are gone are left out, remains are difficult."""
    whole = sample.boxes * np.tile(scale, 2) + np.tile(shift, 2)
    limit = np.array([sample.rgb.shape[1], sample.rgb.shape[0]] * 2)
    boxes = np.clip(whole, 0, limit)
    sides = boxes[:, 2:] - boxes[:, :2]
    kept = sides.prod(axis=1) / np.maximum((whole[:, 2:] - whole[:, :2]).prod(axis=1), 1e-9)
    there = sides.min(axis=1, initial=1e9) > 1.0
    small = np.sqrt(sides.prod(axis=1)) < LEAST_SIDE_PX
    difficult = sample.difficult | (kept < LEAST_KEPT) | small
    return replace(
        sample, boxes=boxes[there].astype(np.float32), classes=sample.classes[there], difficult=difficult[there]
    )


def background(shape: tuple[int, int], rng: Rng) -> Array:
    """A picture of nothing: one colour, a gradient, blobs, or noise."""
    height, width = shape
    kind = rng.integers(4)
    if kind == 0:
        return np.full((height, width, 3), rng.integers(0, 256, 3), np.uint8)
    if kind == 1:
        ends = rng.integers(0, 256, (2, 2, 3)).astype(np.uint8)
        return cv2.resize(ends, (width, height), interpolation=cv2.INTER_LINEAR)
    cells = (max(2, height // int(rng.integers(2, 60))), max(2, width // int(rng.integers(2, 60))))
    coarse = rng.integers(0, 256, (*cells, 3)).astype(np.uint8)
    how = cv2.INTER_NEAREST if kind == 2 else cv2.INTER_CUBIC
    return cv2.resize(coarse, (width, height), interpolation=how)


def change_light(rgb: Array, rng: Rng) -> Array:
    """Another exposure, contrast, gamma, white balance and saturation."""
    gain = np.exp(rng.normal(0, 0.2)) * np.exp(rng.normal(0, 0.06, 3))
    gamma = np.exp(rng.normal(0, 0.2))
    offset = rng.normal(0, 0.04)
    ramp = np.linspace(0, 1, 256)[:, None]
    table = np.clip((np.clip(ramp * gain + offset, 0, 1) ** gamma) * 255, 0, 255).astype(np.uint8)
    rgb = cv2.LUT(rgb, np.ascontiguousarray(table[None]))
    if rng.random() < 0.5:
        grey = cv2.cvtColor(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
        amount = float(rng.choice([0.0, rng.uniform(0, 1), rng.uniform(1, 1.8)], p=[0.1, 0.5, 0.4]))
        rgb = cv2.addWeighted(rgb, amount, grey, 1 - amount, 0)
    if rng.random() < 0.15:
        rgb = np.ascontiguousarray(rgb[..., rng.permutation(3)])
    return rgb


def degrade(rgb: Array, rng: Rng) -> Array:
    """Blur, loss of resolution, noise and JPEG, each now and then."""
    height, width = rgb.shape[:2]
    if rng.random() < 0.2:
        rgb = cv2.GaussianBlur(rgb, (0, 0), rng.uniform(0.3, 1.3))
    elif rng.random() < 0.1:
        rgb = _motion_blur(rgb, rng)
    if rng.random() < 0.1:
        share = rng.uniform(0.4, 0.9)
        small = cv2.resize(rgb, (int(width * share), int(height * share)), interpolation=cv2.INTER_AREA)
        rgb = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    if rng.random() < 0.4:
        rgb = _noise(rgb, rng)
    if rng.random() < 0.2:
        code = cv2.imencode(".jpg", rgb, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 95))])[1]
        rgb = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR))
    return rgb


def _motion_blur(rgb: Array, rng: Rng) -> Array:
    length = int(rng.integers(3, 9))
    kernel = np.zeros((length, length), np.float32)
    angle = rng.uniform(0, np.pi)
    reach = (length - 1) / 2 * np.array([np.cos(angle), np.sin(angle)])
    middle = (length - 1) / 2
    ends = [tuple(int(v) for v in np.rint(middle + sign * reach)) for sign in (-1, 1)]
    cv2.line(kernel, ends[0], ends[1], 1.0)
    return cv2.filter2D(rgb, -1, kernel / kernel.sum())


def _noise(rgb: Array, rng: Rng) -> Array:
    sigma = abs(rng.normal(0, 7))
    shape = rgb.shape if rng.random() < 0.7 else (*rgb.shape[:2], 1)
    noise = rng.standard_normal(shape, np.float32) * np.float32(sigma)
    return np.clip(rgb + noise, 0, 255).astype(np.uint8)
