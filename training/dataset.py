# SPDX-License-Identifier: Apache-2.0
"""Endless batches out of a folder of shards that may still be growing."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
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
    """A sample of the network's size as picture ``(H, W, 3) uint8`` and truth ``(MOST_OBJECTS, 6)``."""
    truth = np.zeros((MOST_OBJECTS, 6), np.float32)
    rows = truth[: len(sample.boxes)]
    rows[:, :4] = sample.boxes[:MOST_OBJECTS]
    rows[:, 4] = sample.classes[:MOST_OBJECTS]
    rows[:, 5] = np.where(sample.difficult[:MOST_OBJECTS], DIFFICULT, WANTED)
    return torch.from_numpy(np.ascontiguousarray(sample.rgb)), torch.from_numpy(truth)


class Stream(IterableDataset[Example]):
    """Augmented examples in random order without end; new shards join as they appear."""

    def __init__(
        self,
        folder: Path,
        seed: tuple[int, ...],
        mosaic_share: float,
        mistakes: Path | None = None,
        look_again_every: int = 2000,
    ) -> None:
        self.pool, self.mistakes = Pool(folder), Pool(mistakes) if mistakes else None
        self.seed, self.mosaic_share, self.look_again_every = seed, mosaic_share, look_again_every

    def __iter__(self) -> Iterator[Example]:
        worker = get_worker_info()
        rng = np.random.default_rng([*self.seed, worker.id if worker else 0])
        torch.set_num_threads(1)
        cv2.setNumThreads(0)
        pick = partial(self.pool.pick, rng)
        pick_mistake = partial(self.mistakes.pick, rng) if self.mistakes else None
        while True:
            for pool in (self.pool, self.mistakes):
                if pool is not None:
                    pool.look()
            for _ in range(self.look_again_every):
                yield example(augment(pick, rng, self.mosaic_share, pick_mistake))


class Pool:
    """The samples of all shards in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._shards: dict[Path, Shard] = {}
        self._places: list[tuple[Shard, int]] = []

    def look(self) -> None:
        """Take in what is new in the folder; an error where there is nothing at all."""
        for path in sorted(self.folder.glob("*.npz")):
            if path not in self._shards:
                self._shards[path] = Shard(path)
                self._places += [(self._shards[path], index) for index in range(len(self._shards[path]))]
        if not self._places:
            raise ValueError(f"{self.folder}: expected shards (*.npz), got none; run training.render first")

    def pick(self, rng: np.random.Generator) -> Sample:
        """Any of the samples."""
        shard, index = self._places[int(rng.integers(len(self._places)))]
        return shard[index]
