# SPDX-License-Identifier: Apache-2.0
"""Depth images of which every object's pixels are known: simulated rooms, and labelled clouds in PCD files."""

from __future__ import annotations

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
KINDS = {("F", 4): "f4", ("F", 8): "f8", ("U", 1): "u1", ("U", 2): "u2", ("U", 4): "u4", ("I", 4): "i4"}


@dataclass(frozen=True)
class Thing:
    """An object of an image: its class, the pixels ``mask (H, W) bool`` that measure it, and its true box."""

    label: str
    mask: Array
    xyxy: tuple[float, float, float, float]


@dataclass(frozen=True)
class LabelledImage:
    """A depth image and the objects that are in it."""

    name: str
    image: DepthImage
    things: tuple[Thing, ...]


def simulated_images(seed: int, count: int) -> Iterator[LabelledImage]:
    """``count`` views of random rooms in which an object of the nine classes is near and mostly visible."""
    found, k = 0, 0
    while found < count:
        scene = random_scene(seed=1000 * seed + k)
        rendering = render(scene, random_view(scene, seed=k), seed=k)
        labelled = _of_rendering(f"room {1000 * seed + k}", rendering)
        found, k = found + bool(labelled.things), k + 1
        if labelled.things:
            yield labelled


def _of_rendering(name: str, r: Rendering) -> LabelledImage:
    """A pixel shows an object where what was measured there is the object and not what is beside it."""
    sound = (r.depth > 0) & (np.abs(r.depth - r.true_depth) < 0.02 + 0.02 * r.true_depth**2)
    things = []
    for seen in r.objects:
        mask = (r.instance == seen.instance) & sound
        near = mask.any() and float(np.median(r.depth[mask])) < FARTHEST
        if near and seen.visibility >= LEAST_VISIBLE and np.count_nonzero(mask) >= LEAST_PIXELS:
            x0, y0, x1, y1 = seen.xyxy.tolist()
            things.append(Thing(seen.label, mask, (x0, y0, x1, y1)))
    return LabelledImage(name, DepthImage(depth=r.depth, rgb=r.rgb, intrinsics=r.intrinsics, stamp_ns=0), tuple(things))


def labelled_clouds(folder: Path) -> Iterator[LabelledImage]:
    """Every PCD file of a folder with organised points and the field ``label``; the class is the name of the file."""
    for path in sorted(folder.glob("*.pcd")):
        fields = read_pcd(path)
        xyz = np.stack([fields["x"], fields["y"], fields["z"]], axis=-1).astype(np.float32)
        packed = fields["rgba"].view(np.uint32)
        rgb = np.stack([packed >> 16, packed >> 8, packed], axis=-1).astype(np.uint8)
        image = organise(PointCloud(xyz=xyz, rgb=rgb, stamp_ns=0))
        numbers = np.where(fields["label"] >= FIRST_OBJECT, fields["label"] // 10, 0)
        masks = [(numbers == n) & (image.depth > 0) for n in np.unique(numbers[numbers > 0])]
        things = [Thing(path.stem.strip("0123456789"), mask, _box(mask)) for mask in masks if mask.sum() >= 300]
        yield LabelledImage(path.stem, image, tuple(things))


def _box(mask: Array) -> tuple[float, float, float, float]:
    rows, cols = np.nonzero(mask)
    return float(cols.min()), float(rows.min()), float(cols.max() + 1), float(rows.max() + 1)


def read_pcd(path: Path) -> dict[str, Array]:
    """The fields of a PCD file as arrays (height, width); binary and binary_compressed. ValueError for other files."""
    content = path.read_bytes()
    head: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in head:
        end = content.index(b"\n", start)
        words = content[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            head[words[0]] = words[1:]
    names, count = head["FIELDS"], int(head["POINTS"][0])
    kinds = [np.dtype(KINDS[t, int(s)]) for t, s in zip(head["TYPE"], head["SIZE"], strict=True)]
    shape = int(head["HEIGHT"][0]), int(head["WIDTH"][0])
    if head["DATA"] == ["binary"]:
        table = np.frombuffer(content, np.dtype(list(zip(names, kinds, strict=True))), count, start)
        return {name: np.ascontiguousarray(table[name]).reshape(shape) for name in names}
    if head["DATA"] != ["binary_compressed"]:
        raise ValueError(f"{path}: expected DATA binary or binary_compressed, got {' '.join(head['DATA'])}")
    return _compressed_fields(content[start:], names, kinds, count, shape)


def _compressed_fields(
    content: bytes, names: list[str], kinds: list[Any], count: int, shape: tuple[int, int]
) -> dict[str, Array]:
    packed, size = np.frombuffer(content, np.uint32, 2)
    raw = _unpack(content[8 : 8 + int(packed)], int(size))
    fields, start = {}, 0
    for name, kind in zip(names, kinds, strict=True):
        fields[name] = np.frombuffer(raw, kind, count, start).reshape(shape)
        start += count * kind.itemsize
    return fields


def _unpack(packed: bytes, size: int) -> bytearray:
    """LZF (Lehmann, liblzf): runs of literals, and copies of what came before."""
    out = bytearray()
    i = 0
    while i < len(packed):
        control = packed[i]
        i += 1
        if control < 32:
            out += packed[i : i + control + 1]
            i += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += packed[i]
            i += 1
        back = ((control & 31) << 8) + packed[i] + 1
        i += 1
        for _ in range(length + 2) if back < length + 2 else ():
            out.append(out[-back])
        if back >= length + 2:
            out += out[len(out) - back : len(out) - back + length + 2]
    if len(out) != size:
        raise ValueError(f"expected {size} bytes of compressed points, got {len(out)}")
    return out


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
