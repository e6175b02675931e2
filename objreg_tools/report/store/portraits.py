# SPDX-License-Identifier: Apache-2.0
"""Small pictures of the objects of a store, each from the keyframe that saw it largest."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registration.keyframe import Keyframe

TILE = 128  # px of a picture
AROUND = 1.5  # how much wider than the object the picture is
MOST = 240  # objects, those that were seen most often
BLANK = 200  # grey where a view has none
WIDEST_DOT = 6  # px of one measured point


def portraits(path: str | Path, sightings: Sequence[Sighting], most: int = MOST) -> dict[int, Array]:
    """(TILE, TILE, 3) uint8 RGB of each landmark: its points in colour upon the grey of the view.

    Of more than ``most`` landmarks those with the most sightings; one without a readable keyframe has none. StoreError
    where the store cannot be read.
    """
    store = Store(path, read_only=True)
    try:
        drawn: dict[int, Array] = {}
        for keyframe_id, shown in _largest(sightings, most).items():
            try:
                keyframe = store.keyframe(keyframe_id)
            except StoreError:
                continue  # a damaged keyframe leaves the others to show
            drawn |= {sighting.landmark: _portrait(keyframe, sighting.instance) for sighting in shown}
        return drawn
    finally:
        store.close()


def _largest(sightings: Sequence[Sighting], most: int) -> dict[int, list[Sighting]]:
    """The sighting of each landmark that fills most of a picture, by keyframe."""
    of: defaultdict[int, list[Sighting]] = defaultdict(list)
    for sighting in sightings:
        of[sighting.landmark].append(sighting)
    chosen: defaultdict[int, list[Sighting]] = defaultdict(list)
    for landmark in sorted(of, key=lambda n: (-len(of[n]), n))[:most]:
        best = max(of[landmark], key=_apparent_size)
        chosen[best.keyframe_id].append(best)
    return chosen


def _apparent_size(sighting: Sighting) -> float:
    return sighting.extent / max(float(np.linalg.norm(sighting.position - sighting.camera)), 1e-3)


def _portrait(keyframe: Keyframe, instance: int) -> Array:
    cloud = next(item.cloud for item in keyframe.objects if item.cloud.instance == instance)
    camera, corner, scale = _window(cloud, keyframe.view.intrinsics)
    picture = _ground(keyframe.view, corner, scale)
    if cloud.rgb is not None:
        _dot(picture, cloud, camera, corner, scale)
    return picture


def _window(cloud: ObjectCloud, camera: Intrinsics) -> tuple[Intrinsics, Array, float]:
    """The upper left corner (2,) of the picture in pixels of the view, and how much larger than these it is."""
    low, high = (f(_pixels(cloud.xyz, camera), axis=0) for f in (np.min, np.max))
    side = max(AROUND * float((high - low).max()), 2.0)
    return camera, (low + high) / 2 - side / 2, TILE / side


def _pixels(xyz: Array, camera: Intrinsics) -> Array:
    z = np.maximum(xyz[:, 2], 1e-3)
    return np.stack([camera.fx * xyz[:, 0] / z + camera.cx, camera.fy * xyz[:, 1] / z + camera.cy], axis=1)


def _ground(view: View, corner: Array, scale: float) -> Array:
    """The grey of the view behind the object."""
    if view.grey is None:
        return np.full((TILE, TILE, 3), BLANK, np.uint8)
    to_tile = np.array([[scale, 0, -scale * corner[0]], [0, scale, -scale * corner[1]]])
    grey = cv2.warpAffine(view.grey, to_tile, (TILE, TILE), flags=cv2.INTER_LINEAR, borderValue=BLANK)
    return np.repeat(grey[..., None], 3, axis=2)


def _dot(picture: Array, cloud: ObjectCloud, camera: Intrinsics, corner: Array, scale: float) -> None:
    """Draw the points in their colours, the nearest last, each as wide as the next is away."""
    far_first = np.argsort(-cloud.xyz[:, 2], kind="stable")
    xyz, rgb = cloud.xyz[far_first], np.asarray(cloud.rgb)[far_first]
    at = np.floor((_pixels(xyz, camera) - corner) * scale).astype(int)
    apart = scale * camera.fx / (float(np.median(xyz[:, 2])) * max(cloud.density, 1.0) ** 0.5)
    width = int(np.clip(np.ceil(apart), 1, WIDEST_DOT))
    for step in np.ndindex(width, width):
        u, v = (at + np.array(step) - width // 2).T
        inside = (u >= 0) & (u < TILE) & (v >= 0) & (v < TILE)
        picture[v[inside], u[inside]] = rgb[inside]
