# SPDX-License-Identifier: Apache-2.0
"""Endless batches out of a folder of shards that may still be growing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import torch
from torch.utils.data import IterableDataset, get_worker_info

from training.augment import augment
from training.multibox import DIFFICULT, WANTED
from training.samples import Sample, Shard

Example = tuple[torch.Tensor, torch.Tensor]

MOST_OBJECTS = 64
"""So many rows of truth has every example, that they may be stacked."""


def example(sample: Sample) -> Example:
    """A sample of the network's size as picture ``(3, H, W) uint8`` and truth ``(MOST_OBJECTS, 6)``."""
    truth = np.zeros((MOST_OBJECTS, 6), np.float32)
    rows = truth[: len(sample.boxes)]
    rows[:, :4] = sample.boxes[:MOST_OBJECTS]
    rows[:, 4] = sample.classes[:MOST_OBJECTS]
    rows[:, 5] = np.where(sample.difficult[:MOST_OBJECTS], DIFFICULT, WANTED)
    return torch.from_numpy(np.ascontiguousarray(sample.rgb.transpose(2, 0, 1))), torch.from_numpy(truth)


class Stream(IterableDataset[Example]):
    """Augmented examples in random order without end; new shards join as they appear."""

    def __init__(self, folder: Path, seed: int, mosaic_share: float, look_again_every: int = 2000) -> None:
        self.folder, self.seed, self.mosaic_share = folder, seed, mosaic_share
        self.look_again_every = look_again_every

    def __iter__(self) -> Iterator[Example]:
        worker = get_worker_info()
        rng = np.random.default_rng([self.seed, worker.id if worker else 0])
        torch.set_num_threads(1)
        cv2.setNumThreads(0)
        shards: dict[Path, Shard] = {}
        while True:
            for path in sorted(self.folder.glob("*.npz")):
                if path not in shards:
                    shards[path] = Shard(path)
            if not shards:
                raise ValueError(f"{self.folder}: expected shards (*.npz), got none; run training.render first")
            places = [(shard, index) for shard in shards.values() for index in range(len(shard))]
            for _ in range(self.look_again_every):
                yield example(augment(lambda: _pick(places, rng), rng, self.mosaic_share))  # noqa: B023


def _pick(places: list[tuple[Shard, int]], rng: np.random.Generator) -> Sample:
    shard, index = places[int(rng.integers(len(places)))]
    return shard[index]
