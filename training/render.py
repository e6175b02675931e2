# SPDX-License-Identifier: Apache-2.0
"""Render shards of labelled pictures; it can be stopped and started again.

python -m training.render DATA --seed 1 --shards 160
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.params import ColourParams
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.world.scene import Scene, random_view
from training.augment import background
from training.labels import LABELS
from training.priors import INPUT_HW
from training.samples import Sample, write_shard
from training.scenes import hard_scene, plain_scene, training_scene, training_view

VIEWS_PER_SCENE = 6
SHARD = 200
PLAIN_SHARE = 0.8
"""Of the scenes, so many are the simulator's own, seen by its own camera; the others are made to differ."""

EMPTY_SHARE = 0.15
"""Of the pictures without an object to be found, so many are kept."""

LEAST_VISIBILITY = 0.3
"""An object of which less is visible is difficult: it teaches neither what it is nor what it is not."""

LEAST_SIDE_PX, LEAST_AREA_PX = 4.0, 64.0
"""So is one that is smaller in the picture."""


def sample_of(rendering: Rendering) -> Sample:
    """The picture and its labels."""
    assert rendering.rgb is not None
    seen = rendering.objects
    boxes = np.array([one.xyxy for one in seen], np.float32).reshape(-1, 4)
    difficult = np.array([one.visibility < LEAST_VISIBILITY for one in seen], bool) | is_small(boxes)
    return Sample(rendering.rgb, boxes, np.array([LABELS.index(one.label) for one in seen], np.int64), difficult)


def is_small(boxes: Array) -> Array:
    """Which of the boxes ``(N, 4)`` are too small to teach anything: ``(N,) bool``."""
    sides = boxes[:, 2:] - boxes[:, :2]
    return (sides.min(axis=1, initial=1e9) < LEAST_SIDE_PX) | (sides.prod(axis=1) < LEAST_AREA_PX)


def samples(rng: np.random.Generator) -> Iterator[Sample]:
    """Pictures of one scene; few of them without an object."""
    plain = rng.random() < PLAIN_SHARE
    scene, poses = plain_scene(rng) if plain else training_scene(rng)
    for _ in range(VIEWS_PER_SCENE):
        sample = _plain_sample(scene, poses, rng) if plain else sample_of(_picture(scene, poses, rng))
        if not sample.difficult.all() or rng.random() < EMPTY_SHARE:
            yield sample


def hard_samples(rng: np.random.Generator) -> Iterator[Sample]:
    """Pictures of one scene by the simulator's own Kinect, full of what is hardest to learn."""
    scene, poses = hard_scene(rng)
    for _ in range(VIEWS_PER_SCENE):
        sample = _plain_sample(scene, poses, rng)
        if not sample.difficult.all() or rng.random() < EMPTY_SHARE:
            yield sample


def _plain_sample(scene: Scene, poses: Array, rng: np.random.Generator) -> Sample:
    """What the detector gets of the simulator's own Kinect."""
    T = poses[int(rng.integers(len(poses)))] if len(poses) else random_view(scene, int(rng.integers(2**31)))
    return sample_of(render(scene, T, seed=int(rng.integers(2**31))))


def _picture(scene: Scene, poses: Array, rng: np.random.Generator) -> Rendering:
    """One picture of the scene by some camera."""
    height, width = INPUT_HW
    focal = width * np.exp(rng.uniform(np.log(0.65), np.log(1.2)))
    camera = Intrinsics(fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2, width=width, height=height)
    T = training_view(scene, poses, rng, focal, width)
    colour = ColourParams(
        brightness=rng.uniform(0.25, 0.65),
        blur=rng.uniform(0.0, 0.8),
        shot_noise=rng.uniform(0, 0.02),
        read_noise=rng.uniform(0, 0.01),
        vignetting=rng.uniform(0, 0.3),
        tint=tuple(float(gain) for gain in np.exp(rng.normal(0, 0.06, 3))),
    )
    rendering = render(scene, T, camera, seed=int(rng.integers(2**31)), colour=colour)
    assert rendering.rgb is not None
    if rng.random() < 0.12:
        empty = rendering.instance == 0
        rendering.rgb[empty] = background(INPUT_HW, rng)[empty]
    return rendering


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1, help="other seeds give other pictures and may run beside it")
    parser.add_argument("--shards", type=int, default=160, help=f"of {SHARD} pictures each")
    parser.add_argument("--hard", action="store_true", help="only scenes full of what is hardest to learn")
    arguments = parser.parse_args()
    some = hard_samples if arguments.hard else samples
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for number in range(arguments.shards):
        path = arguments.folder / f"{arguments.seed:03d}-{number:05d}.npz"
        if path.exists():
            continue
        rng = np.random.default_rng([arguments.seed, number])
        pictures: list[Sample] = []
        while len(pictures) < SHARD:
            pictures += some(rng)
        write_shard(path, pictures[:SHARD])
        print(f"{path}", flush=True)


if __name__ == "__main__":
    main()
