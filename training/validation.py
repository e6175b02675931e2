# SPDX-License-Identifier: Apache-2.0
"""Pictures to judge a model by, and the judgement, made by the very detector that will run it.

The pictures are 640 x 480 ones of the simulator's Kinect with its default noise: one half of ordinary rooms
(`random_scene`) from hand-held views (`random_view`), the other half frames of its scenarios (`make_plan`). No
training picture shares a scene with them: training draws the numbers of its scenes below `FIRST_SCENE`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice
from itertools import count as count_from
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_tools.report.run.average_precision import TrueBoxes, average_precision
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.scenarios import OF_ONE_DAY, make_plan
from objreg_tools.simulation.world.scene import Scene, random_scene, random_view
from training.labels import LABELS
from training.samples import Sample, Shard, write_shard

FIRST_SCENE = 2**31
SCENES_PER_SEED = 10_000
VIEWS_PER_SCENE = 6
PICTURES_PER_ROUND = 2 * VIEWS_PER_SCENE
PLAN_FRAMES = 120


@dataclass(frozen=True)
class Demand:
    """Which objects a model must find; the others are difficult: they need not be found, and finding them is no error.

    ``visibility``: the least visible share of the outline, where what the border cuts off is not visible;
    ``area_px``, ``side_px``: the least area and side of the box in the 640 x 480 picture.
    """

    visibility: float
    area_px: float
    side_px: float = 12.0


REASONABLE = Demand(visibility=0.5, area_px=32.0**2)
"""What an object must show before registration can use it. Boxes from 32 x 32 px are what COCO calls medium and large
(Lin et al., "Microsoft COCO", 2014); below it the Kinect leaves a few hundred points at best. Half hidden is between
KITTI's "moderate" (Geiger et al., 2012) and the "reasonable" of pedestrian detection, which asks for 65 % and 50 px of
height (Dollar et al., "Pedestrian Detection", 2012)."""

EVERYTHING = Demand(visibility=0.3, area_px=400.0)
"""Small and mostly hidden objects too, down to where a person would begin to guess."""

LARGE = Demand(visibility=0.3, area_px=64.0**2)

RANKING = DetectorParams(threshold=0.02, max_detections=100, cross_label_iou=1.0, min_side=0.0)
"""Everything down to a low score, because average precision ranks."""


@dataclass(frozen=True, eq=False)
class Labelled:
    """``rgb (H, W, 3) uint8`` and what is visible: ``boxes (N, 4) float32``, ``classes (N,)``, ``visibility (N,)``."""

    rgb: Array
    boxes: Array
    classes: Array
    visibility: Array

    def difficult(self, demand: Demand) -> Array:
        """``(N,) bool``: what the demand does not ask for."""
        sides = self.boxes[:, 2:] - self.boxes[:, :2]
        small = (sides.min(axis=1, initial=1e9) < demand.side_px) | (sides.prod(axis=1) < demand.area_px)
        return small | (self.visibility < demand.visibility)

    def truth(self, demand: Demand) -> TrueBoxes:
        """What average precision compares to."""
        return TrueBoxes(self.boxes, tuple(LABELS[index] for index in self.classes), self.difficult(demand))

    def sample(self, demand: Demand) -> Sample:
        """As a shard keeps it."""
        return Sample(self.rgb, self.boxes, self.classes, self.difficult(demand))


def pictures(seed: int, count: int, processes: int = 1) -> Iterator[Labelled]:
    """``count`` labelled pictures; other seeds share no scene. The number of ``processes`` changes the time only."""
    if processes == 1:
        yield from islice(chain.from_iterable(_round(seed, number) for number in count_from()), count)
        return
    rounds = range(-(-count // PICTURES_PER_ROUND))
    with get_context("spawn").Pool(processes) as pool:
        yield from islice(chain.from_iterable(pool.imap(partial(_whole_round, seed), rounds)), count)


def _whole_round(seed: int, number: int) -> list[Labelled]:
    return list(_round(seed, number))


def _round(seed: int, number: int) -> Iterator[Labelled]:
    """Views of one room, then as many frames of a scenario."""
    for place, (scene, T_world_camera) in enumerate(_views(FIRST_SCENE + seed * SCENES_PER_SEED + number)):
        yield labelled(render(scene, T_world_camera, seed=number * PICTURES_PER_ROUND + place))


def _views(number: int) -> Iterator[tuple[Scene, Array]]:
    """Scenes and ``T_world_camera`` of one round."""
    scene = random_scene(number)
    yield from ((scene, random_view(scene, number + view)) for view in range(VIEWS_PER_SCENE))
    plan = make_plan(list(OF_ONE_DAY)[number % len(OF_ONE_DAY)], number, PLAN_FRAMES)
    for frame in np.linspace(0, PLAN_FRAMES - 1, VIEWS_PER_SCENE + 2).astype(int)[1:-1]:
        yield plan.scenes[plan.scene_of[frame]], plan.T_world_camera[frame]


def labelled(rendering: Rendering) -> Labelled:
    """The picture and its labels."""
    assert rendering.rgb is not None
    seen = rendering.objects
    boxes = np.array([one.xyxy for one in seen], np.float32).reshape(-1, 4)
    classes = np.array([LABELS.index(one.label) for one in seen], np.int64)
    return Labelled(rendering.rgb, boxes, classes, np.array([one.visibility for one in seen]))


def look(detector: Detector, pictures: Iterable[Sample | Labelled]) -> list[Detections]:
    """What the detector sees in every picture."""
    return [detector.detect(ColourImage(rgb=picture.rgb, stamp_ns=0)) for picture in pictures]


def precisions(seen: list[Detections], truth: list[TrueBoxes], demand: Demand) -> dict[str, float]:
    """Average precision at IoU 0.5 of every label that occurs, and ``mean``; ``truth`` knows the demand already."""
    found = {label: average_precision(seen, truth, label, least_area=demand.area_px) for label in LABELS}
    known = {label: value for label, value in found.items() if value is not None}
    return known | {"mean": float(np.mean(list(known.values())))}


def validate_model(model: Path, folder: Path) -> dict[str, float]:
    """`precisions` of a model file on a folder of shards."""
    samples = [shard[k] for shard in map(Shard, sorted(folder.glob("*.npz"))) for k in range(len(shard))]
    truth = [TrueBoxes(one.boxes, tuple(LABELS[index] for index in one.classes), one.difficult) for one in samples]
    return precisions(look(Detector(RANKING, model), samples), truth, REASONABLE)


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
    samples = (one.sample(REASONABLE) for one in pictures(arguments.seed, arguments.count))
    write_shard(arguments.folder / f"{arguments.seed}.npz", samples)


if __name__ == "__main__":
    main()
