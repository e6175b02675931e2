# SPDX-License-Identifier: Apache-2.0
"""Small pictures of one object, or of none, cut out of the shards: what the backbone learns to see by first."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import IterableDataset, get_worker_info

from training.augment import change_light, degrade
from training.samples import Sample, Shard

Array = NDArray[Any]
Rng = np.random.Generator

CROP_PX = 64
NOTHING = 0
"""The class of a crop without an object; objects are 1 + their class."""


def crops(sample: Sample, rng: Rng) -> Iterator[tuple[Array, int]]:
    """Every object of the picture once, with some surroundings, and a piece without objects."""
    for box, label, difficult in zip(sample.boxes, sample.classes, sample.difficult, strict=True):
        if not difficult:
            yield _finish(_cut(sample.rgb, _around(box, rng)), rng), int(label) + 1
    window = _random_window(sample.rgb.shape[:2], rng)
    if not _touches(window, sample.boxes):
        yield _finish(_cut(sample.rgb, window), rng), NOTHING


def _around(box: Array, rng: Rng) -> Array:
    """A square around a box: centre x, centre y, side."""
    side = max(box[2:] - box[:2]) * np.exp(rng.uniform(np.log(0.9), np.log(1.8)))
    centre = (box[:2] + box[2:]) / 2 + rng.uniform(-0.15, 0.15, 2) * side
    return np.array([*centre, side])


def _random_window(shape: tuple[int, int], rng: Rng) -> Array:
    side = np.exp(rng.uniform(np.log(20), np.log(200)))
    return np.array([rng.uniform(0, shape[1]), rng.uniform(0, shape[0]), side])


def _touches(window: Array, boxes: Array) -> bool:
    low, high = window[:2] - window[2] / 2, window[:2] + window[2] / 2
    return bool(((boxes[:, 2:] > low) & (boxes[:, :2] < high)).all(axis=1).any())


def _cut(rgb: Array, window: Array) -> Array:
    """The square of the picture at the size of a crop."""
    scale = CROP_PX / window[2]
    shift = CROP_PX / 2 - window[:2] * scale
    source = cv2.blur(rgb, (2, 2)) if scale < 0.6 else rgb
    M = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    return cv2.warpAffine(source, M, (CROP_PX, CROP_PX), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)


def _finish(rgb: Array, rng: Rng) -> Array:
    if rng.random() < 0.5:
        rgb = np.ascontiguousarray(rgb[:, ::-1])
    if rng.random() < 0.8:
        rgb = change_light(rgb, rng)
    return degrade(rgb, rng)


class CropStream(IterableDataset[tuple[torch.Tensor, int]]):
    """Crops in random order without end."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.seed = folder, seed

    def __iter__(self) -> Iterator[tuple[torch.Tensor, int]]:
        worker = get_worker_info()
        rng = np.random.default_rng([self.seed, worker.id if worker else 0])
        torch.set_num_threads(1)
        cv2.setNumThreads(0)
        shards = [Shard(path) for path in sorted(self.folder.glob("*.npz"))]
        while True:
            waiting: list[tuple[Array, int]] = []
            while len(waiting) < 512:
                shard = shards[int(rng.integers(len(shards)))]
                waiting += crops(shard[int(rng.integers(len(shard)))], rng)
            for index in rng.permutation(len(waiting)):
                rgb, label = waiting[index]
                yield torch.from_numpy(np.ascontiguousarray(rgb.transpose(2, 0, 1))), label
