# SPDX-License-Identifier: Apache-2.0
"""Pictures to judge a model by, and the judgement, made by the very detector that will run it.

The pictures are 640 x 480 ones of the simulator's Kinect with its default noise: one half of ordinary rooms
(`random_scene`) from hand-held views (`random_view`), the other half frames of its scenarios (`make_story`). No
training picture shares a scene with them: training draws the numbers of its scenes below `FIRST_SCENE`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import count as count_from
from pathlib import Path

import numpy as np

from objreg_ros.data import Array, ColourImage, Detections
from objreg_ros.detector.boxes import area
from objreg_ros.detector.mobilenet_ssd import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.report.average_precision import TrueBoxes, average_precision
from objreg_ros.simulation.render import Rendering, render
from objreg_ros.simulation.scenarios import SCENARIOS, make_story
from objreg_ros.simulation.scene import Scene, random_scene, random_view
from training.labels import LABELS
from training.samples import Sample, Shard, write_shard

FIRST_SCENE = 2**31
SCENES_PER_SEED = 10_000
VIEWS_PER_SCENE = 6
STORY_FRAMES = 120

LEAST_VISIBILITY = 0.3
LEAST_SIDE_PX = 12.0
LEAST_AREA_PX = 400.0
"""In the 640 x 480 picture: objects of which less is visible, or whose box is thinner or smaller, are difficult; they
need not be found, and finding them is no error."""

RANKING = DetectorParams(threshold=0.02, max_detections=100, cross_label_iou=1.0, min_side=0.0)
"""Everything down to a low score, because average precision ranks."""


def pictures(seed: int, count: int) -> Iterator[Sample]:
    """``count`` labelled pictures; other seeds share no scene."""
    for number, (scene, T_world_camera) in zip(range(count), _views(seed), strict=False):
        yield sample_of(render(scene, T_world_camera, seed=number))


def _views(seed: int) -> Iterator[tuple[Scene, Array]]:
    """Scenes and ``T_world_camera`` without end: views of a room, then as many frames of a scenario, and so on."""
    for number in count_from(FIRST_SCENE + seed * SCENES_PER_SEED):
        scene = random_scene(number)
        yield from ((scene, random_view(scene, number + view)) for view in range(VIEWS_PER_SCENE))
        story = make_story(list(SCENARIOS)[number % len(SCENARIOS)], number, STORY_FRAMES)
        for frame in np.linspace(0, STORY_FRAMES - 1, VIEWS_PER_SCENE + 2).astype(int)[1:-1]:
            yield story.scenes[story.scene_of[frame]], story.T_world_camera[frame]


def sample_of(rendering: Rendering) -> Sample:
    """The picture and its labels, difficult ones marked."""
    assert rendering.rgb is not None
    seen = rendering.objects
    boxes = np.array([one.xyxy for one in seen], np.float32).reshape(-1, 4)
    sides = boxes[:, 2:] - boxes[:, :2]
    difficult = np.array([one.visibility < LEAST_VISIBILITY for one in seen], bool)
    difficult |= (sides.min(axis=1, initial=1e9) < LEAST_SIDE_PX) | (sides.prod(axis=1) < LEAST_AREA_PX)
    return Sample(rendering.rgb, boxes, np.array([LABELS.index(one.label) for one in seen], np.int64), difficult)


def look(detector: Detector, samples: Iterable[Sample]) -> tuple[list[Detections], list[TrueBoxes]]:
    """What the detector sees in every picture, and what is there."""
    seen, truth = [], []
    for sample in samples:
        seen.append(detector.detect(ColourImage(rgb=sample.rgb, stamp_ns=0)))
        names = tuple(LABELS[index] for index in sample.classes)
        truth.append(TrueBoxes(sample.boxes, names, sample.difficult))
    return seen, truth


def precisions(seen: list[Detections], truth: list[TrueBoxes], least_area_px: float = 0.0) -> dict[str, float]:
    """Average precision at IoU 0.5 of every label that occurs, and ``mean``; smaller boxes become difficult."""
    asked = [replace(known, difficult=known.difficult | (area(known.xyxy) < least_area_px)) for known in truth]
    found = {label: average_precision(seen, asked, label) for label in LABELS}
    known = {label: value for label, value in found.items() if value is not None}
    return known | {"mean": float(np.mean(list(known.values())))}


def validate_model(model: Path, folder: Path) -> dict[str, float]:
    """`precisions` of a model file on a folder of shards."""
    shards = map(Shard, sorted(folder.glob("*.npz")))
    return precisions(*look(Detector(RANKING, model), (shard[k] for shard in shards for k in range(len(shard)))))


def describe(precisions: dict[str, float]) -> str:
    """One line of them."""
    return ", ".join(f"{label} {value:.3f}" for label, value in precisions.items())


def main() -> None:
    """Write validation pictures to a folder: python -m training.validation FOLDER --seed N --count M."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=999)
    parser.add_argument("--count", type=int, default=300)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    write_shard(arguments.folder / f"{arguments.seed}.npz", pictures(arguments.seed, arguments.count))


if __name__ == "__main__":
    main()
