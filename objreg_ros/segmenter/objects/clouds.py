# SPDX-License-Identifier: Apache-2.0
"""The clouds of a frame: of each object, and of the support surfaces."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED, ObjectCloud, PointFlag
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects.extract import Pixels, cell_points, colours
from objreg_ros.segmenter.objects.isolate import Isolated
from objreg_ros.segmenter.objects.targets import Target
from objreg_ros.segmenter.objects.unnamed import UnnamedPixels
from objreg_ros.segmenter.surface.support import COARSE, Ground


def object_clouds(
    targets: Sequence[Target], found: Iterable[Isolated], unnamed: Iterable[UnnamedPixels], min_points: int
) -> tuple[ObjectCloud, ...]:
    """The clouds of what was ``found`` for each target, less those of few points; then those without a name."""
    named = [(target, one) for target, one in zip(targets, found, strict=True) if len(one.pixels) >= min_points]
    instance = itertools.count(1)
    clouds = [
        _cloud(target.label, target.score, next(instance), one.pixels, one.flags, target.detection_id)
        for target, one in named
    ]
    others = itertools.islice(unnamed, max(0, limits.MOST_OBJECTS - len(clouds)))
    return (*clouds, *(_cloud(UNNAMED, one.own, next(instance), one.pixels, one.flags) for one in others))


def _cloud(
    label: str, score: float, instance: int, pixels: Pixels, flags: PointFlag, detection_id: str = ""
) -> ObjectCloud:
    return ObjectCloud(
        label=label,
        score=score,
        instance=instance,
        xyz=pixels.xyz,
        normals=pixels.normals,
        rgb=pixels.rgb,
        flags=pixels.edge | np.uint16(flags),
        density=len(pixels) / max(pixels.area, 1e-9),
        detection_id=detection_id,
    )


def support_cloud(depth: DepthImage, ground: Ground, taken: Array) -> ObjectCloud | None:
    """The coarse cells of the support surfaces that are of no object, one point each; None where there are none.

    ``taken (h, w) bool`` are the cells of the whole frame that are of a named object.
    """
    if not ground.supports:
        return None
    cells = ground.supports[0].parts > 0
    for support in ground.supports[1:]:
        cells |= support.parts > 0
    cells &= ~taken[::COARSE, ::COARSE]
    xyz, normals, rgb = cell_points(ground.coarse, cells, colours(depth))
    if len(xyz) == 0:
        return None
    area = sum(support.area for support in ground.supports)
    return ObjectCloud(
        label="support",
        score=1.0,
        instance=0,
        xyz=xyz,
        normals=normals,
        rgb=None if depth.rgb is None else rgb,
        flags=np.zeros(len(xyz), np.uint16),
        density=len(xyz) / max(area, 1e-9),
    )
