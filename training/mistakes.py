# SPDX-License-Identifier: Apache-2.0
"""Cut out of the training pictures what a network still gets wrong: objects that it misses and what it takes
for objects (after Sung and Poggio's bootstrapping, 1998, and Shrivastava et al., "Online Hard Example Mining", 2016).

python -m training.mistakes DATA MISTAKES --model OUT/model.onnx
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.detector.boxes import iou
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from training.augment import cut
from training.labels import LABELS
from training.samples import Sample, Shard, write_shard

WIDTH_PX, HEIGHT_PX = 640, 480
"""Only whole pictures of the Kinect are searched."""

CROP_HW = (192, 256)
"""The size of what is cut out: most objects with their surroundings as large as they were."""

SURROUNDINGS = 1.6
"""Larger objects are shrunk until the crop is so many times as large as they."""

LEAST_AREA_PX = 28.0**2
"""Smaller ones are mostly a matter of luck."""

BELOW, ABOVE = 0.5, 0.2
"""An object that is scored lower is as good as missed; anything else that is scored higher is as good as found."""

MOST_A_PICTURE = 8


def mistakes(sample: Sample, seen: Detections) -> Array:
    """The boxes ``(M, 4)`` of what was missed, and of what was seen and is not there."""
    names = np.array(LABELS)[sample.classes]
    same = np.array(seen.label, dtype=str)[None] == names[:, None]
    overlap = iou(sample.boxes, seen.xyxy)
    found = np.where(same & (overlap >= 0.5), seen.score[None], 0.0).max(axis=1, initial=0.0) >= BELOW
    missed = sample.boxes[~found & ~sample.difficult]
    explained = ((same | sample.difficult[:, None]) & (overlap >= 0.4)).any(axis=0)
    false = seen.xyxy[(seen.score >= ABOVE) & ~explained]
    both = np.concatenate([missed, false]).astype(np.float32)
    return both[(both[:, 2:] - both[:, :2]).prod(axis=1) >= LEAST_AREA_PX]


def window_around(box: Array) -> Array:
    """The window of the crop's aspect in whose middle the box lies."""
    size = np.array(CROP_HW[::-1], float)
    size *= max(1.0, float((SURROUNDINGS * (box[2:] - box[:2]) / size).max()))
    centre = (box[:2] + box[2:]) / 2
    return np.concatenate([centre - size / 2, centre + size / 2])


def crops(sample: Sample, detector: Detector, rng: np.random.Generator) -> Iterator[Sample]:
    """One crop for every mistake in the picture, of some where there are many."""
    wrong = mistakes(sample, detector.detect(ColourImage(rgb=sample.rgb, stamp_ns=0)))
    for box in rng.permutation(wrong)[:MOST_A_PICTURE]:
        crop = cut(sample, window_around(box), CROP_HW, rng)
        yield replace(crop, rgb=np.ascontiguousarray(crop.rgb))


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of shards from training.render")
    parser.add_argument("folder", type=Path, help="where the shards of crops go")
    parser.add_argument("--model", type=Path, required=True, help="the model that makes the mistakes")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    detector = Detector(DetectorParams(threshold=ABOVE, max_detections=100, min_side=0.0), arguments.model)
    for number, path in enumerate(sorted(arguments.data.glob("*.npz"))):
        target, shard, rng = arguments.folder / path.name, Shard(path), np.random.default_rng(number)
        if target.exists():
            continue
        samples = (shard[index] for index in range(len(shard)))
        whole = (sample for sample in samples if sample.rgb.shape == (HEIGHT_PX, WIDTH_PX, 3))
        found = [crop for sample in whole for crop in crops(sample, detector, rng)]
        if found:
            write_shard(target, found)
            print(f"{target}: {len(found)}", flush=True)


if __name__ == "__main__":
    main()
