# SPDX-License-Identifier: Apache-2.0
"""A labelled picture, and shards of many in a folder: pictures as JPEG, boxes as arrays, one ``.npz`` a shard."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

JPEG_QUALITY = 95


@dataclass
class Sample:
    """``rgb (H, W, 3) uint8``; ``boxes (N, 4) float32`` x_min y_min x_max y_max in pixels, half open, of what is
    visible; ``classes (N,) int64``; ``difficult (N,) bool`` where too little is visible to ask for it.
    """

    rgb: Array
    boxes: Array
    classes: Array
    difficult: Array


def write_shard(path: Path, samples: Iterable[Sample]) -> None:
    """Write a shard; it appears under its name only when it is complete."""
    samples = list(samples)
    pictures = [_encode(sample.rgb) for sample in samples]
    temporary = path.with_suffix(".part")
    with temporary.open("wb") as file:
        np.savez(
            file,
            jpeg=np.concatenate(pictures),
            jpeg_size=np.array([len(picture) for picture in pictures]),
            boxes=np.concatenate([sample.boxes.reshape(-1, 4) for sample in samples]).astype(np.float32),
            classes=np.concatenate([sample.classes for sample in samples]).astype(np.int64),
            difficult=np.concatenate([sample.difficult for sample in samples]).astype(bool),
            box_count=np.array([len(sample.boxes) for sample in samples]),
        )
    os.replace(temporary, path)


class Shard:
    """The samples of one shard file, pictures still compressed."""

    def __init__(self, path: Path) -> None:
        with np.load(path) as content:
            self._jpeg = np.split(content["jpeg"], np.cumsum(content["jpeg_size"])[:-1])
            ends = np.cumsum(content["box_count"])[:-1]
            self._boxes, self._classes, self._difficult = (
                np.split(content[key], ends) for key in ("boxes", "classes", "difficult")
            )

    def __len__(self) -> int:
        return len(self._jpeg)

    def __getitem__(self, index: int) -> Sample:
        bgr = np.asarray(cv2.imdecode(self._jpeg[index], cv2.IMREAD_COLOR))
        rgb = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
        return Sample(rgb, self._boxes[index].copy(), self._classes[index].copy(), self._difficult[index].copy())


def _encode(rgb: Array) -> Array:
    return cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].reshape(-1)
