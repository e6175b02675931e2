# SPDX-License-Identifier: Apache-2.0
"""A keyframe whose objects have fewer points, in the same order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.registration.keyframe import Keyframe, KeyObject

NEAREST_M = 0.01  # no camera measures depth so near
LEAST_POINTS = 200  # that an object keeps


def in_front(keyframe: Keyframe) -> Keyframe:
    """The keyframe without what of its objects is nearer than `NEAREST_M` or behind the camera."""
    before = [(item, item.cloud.xyz[:, 2] >= NEAREST_M) for item in keyframe.objects]
    return replace(keyframe, objects=tuple(_kept(item, np.flatnonzero(front)) for item, front in before if front.any()))


def thinned(keyframe: Keyframe, fewer: float) -> Keyframe:
    """The keyframe with about so many points ``fewer``, evenly of all objects and evenly along each."""
    total = sum(len(item.cloud) for item in keyframe.objects)
    share = max(0.0, 1.0 - fewer / max(total, 1))
    return replace(keyframe, objects=tuple(_thinned_object(item, share) for item in keyframe.objects))


def _thinned_object(item: KeyObject, share: float) -> KeyObject:
    count = len(item.cloud)
    left = min(count, max(LEAST_POINTS, int(share * count)))
    return _kept(item, np.arange(left) * count // left)


def _kept(item: KeyObject, chosen: Array) -> KeyObject:
    return replace(item, cloud=picked(item.cloud, chosen))


def picked(cloud: ObjectCloud, chosen: Array | slice) -> ObjectCloud:
    """The cloud with the ``chosen`` of its points, each with its own colour, normal and flags."""
    arrays = {name: getattr(cloud, name)[chosen] for name in ("xyz", "normals", "flags")}
    return replace(cloud, rgb=None if cloud.rgb is None else cloud.rgb[chosen], **arrays)
