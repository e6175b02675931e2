# SPDX-License-Identifier: Apache-2.0
"""Depth images of which every object's pixels are known: simulated rooms, and labelled clouds in PCD files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Detections, PointCloud
from objreg_ros.segmenter.sensor.organise import organise
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.world.scene import random_scene, random_view

LEAST_VISIBLE = 0.6  # of a simulated object's outline
LEAST_PIXELS = 1000
FARTHEST = 1.75  # m, the founding method's range
FIRST_OBJECT = 20  # labels of a cloud below it are the table; ten labels are the parts of one object


@dataclass(frozen=True)
class LabelledObject:
    """An object of an image: its class, the pixels ``mask (H, W) bool`` that measure it, and its true box."""

    label: str
    mask: Array
    xyxy: tuple[float, float, float, float]


@dataclass(frozen=True)
class LabelledImage:
    """A depth image and the objects that are in it."""

    name: str
    image: DepthImage
    objects: tuple[LabelledObject, ...]


def simulated_images(seed: int, count: int) -> Iterator[LabelledImage]:
    """``count`` views of random rooms in which an object of the nine classes is near and mostly visible."""
    found, k = 0, 0
    while found < count:
        scene = random_scene(seed=1000 * seed + k)
        rendering = render(scene, random_view(scene, seed=k), seed=k)
        labelled = _of_rendering(f"room {1000 * seed + k}", rendering)
        found, k = found + bool(labelled.objects), k + 1
        if labelled.objects:
            yield labelled


def _of_rendering(name: str, r: Rendering) -> LabelledImage:
    """A pixel shows an object where what was measured there is the object and not what is beside it."""
    sound = (r.depth > 0) & (np.abs(r.depth - r.true_depth) < 0.02 + 0.02 * r.true_depth**2)
    objects = []
    for seen in r.objects:
        mask = (r.instance == seen.instance) & sound
        near = mask.any() and float(np.median(r.depth[mask])) < FARTHEST
        if near and seen.visibility >= LEAST_VISIBLE and np.count_nonzero(mask) >= LEAST_PIXELS:
            x0, y0, x1, y1 = seen.xyxy.tolist()
            objects.append(LabelledObject(seen.label, mask, (x0, y0, x1, y1)))
    return LabelledImage(
        name, DepthImage(depth=r.depth, rgb=r.rgb, intrinsics=r.intrinsics, stamp_ns=0), tuple(objects)
    )


def labelled_clouds(folder: Path) -> Iterator[LabelledImage]:
    """Every PCD file of a folder with organised points and the field ``label``; the class is the name of the file."""
    import open3d

    for path in sorted(folder.glob("*.pcd")):
        cloud = open3d.t.io.read_point_cloud(str(path)).point
        columns = ("positions", "colors", "label")
        xyz, rgb, label = (cloud[name].numpy().reshape(*_shape(path), -1) for name in columns)
        image = organise(PointCloud(xyz=xyz, rgb=rgb, stamp_ns=0))
        numbers = np.where(label >= FIRST_OBJECT, label // 10, 0)[..., 0]
        masks = [(numbers == n) & (image.depth > 0) for n in np.unique(numbers[numbers > 0])]
        objects = [
            LabelledObject(path.stem.strip("0123456789"), mask, _box(mask)) for mask in masks if mask.sum() >= 300
        ]
        yield LabelledImage(path.stem, image, tuple(objects))


def _shape(path: Path) -> tuple[int, int]:
    """Rows and columns of the points of a PCD file, which Open3D does not say; ValueError for what is none."""
    sizes = dict(re.findall(rb"^(HEIGHT|WIDTH) (\d+)$", path.read_bytes(), re.MULTILINE))
    if len(sizes) < 2:
        raise ValueError(f"{path}: expected a PCD file, got one without height and width")
    return int(sizes[b"HEIGHT"]), int(sizes[b"WIDTH"])


def _box(mask: Array) -> tuple[float, float, float, float]:
    rows, cols = np.nonzero(mask)
    return float(cols.min()), float(rows.min()), float(cols.max() + 1), float(rows.max() + 1)


def jittered(box: tuple[float, float, float, float], low: float, high: float, rng: Any) -> list[float]:
    """``box`` with each edge moved outwards by a share of the box's size that is drawn from ``low`` … ``high``."""
    x0, y0, x1, y1 = box
    left, top, right, bottom = rng.uniform(low, high, 4) * [x1 - x0, y1 - y0, x1 - x0, y1 - y0]
    return [x0 - left, y0 - top, x1 + right, y1 + bottom]


def detections(boxes: list[list[float]], labels: list[str], image: DepthImage) -> Detections:
    """Detections of these boxes, clipped to the image."""
    height, width = image.depth.shape
    xyxy = np.array(boxes, np.float32).reshape(-1, 4)
    return Detections(
        xyxy=np.clip(xyxy, 0, np.array([width, height] * 2, np.float32)),
        score=np.ones(len(boxes), np.float32),
        label=tuple(labels),
        image_hw=(height, width),
        stamp_ns=image.stamp_ns,
    )
