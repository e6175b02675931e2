# SPDX-License-Identifier: Apache-2.0
"""Keypoints of a view's grey: SIFT (Lowe, 2004), each with its line of sight and, where depth is known, its point.

The view is enough: enlarged by half it gives as many right poses as SIFT or ORB of the whole picture
(docs/tried.md), so nothing more of the picture is stored or sent for them.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.registration.prepare.normals import view_normals

ENLARGED = 1.5  # times, before SIFT doubles the picture once more
MOST = 600  # keypoints, the strongest
RATIO = 0.95  # of the distances of the nearest and the second nearest descriptor: votes and views judge, not the ratio
LEAST_DISTANCE = 1e-3  # of two descriptors, so that twins have a ratio


class Keypoints(NamedTuple):
    """N keypoints: ``rays (N, 2)`` of their line of sight at 1 m, ``xyz (N, 3)`` m, ``normals (N, 3)`` towards the
    camera and ``descriptors (N, 128)`` float32 of length 1. Points and normals are 0 0 0 where unknown. ``focal_px``
    is that of the view. N is 0 without grey.
    """

    rays: Array
    xyz: Array
    normals: Array
    descriptors: Array
    focal_px: float

    def __len__(self) -> int:
        return len(self.rays)

    @property
    def measured(self) -> Array:
        """(N,) bool: which have a point."""
        return np.asarray(self.xyz[:, 2] > 0.0)


def find_keypoints(view: View, farthest: float, normals: Array | None = None) -> Keypoints:
    """The keypoints of a view; points beyond ``farthest`` m are unknown.

    ``normals (h, w, 3)`` are the `view_normals`, computed here where not given.
    """
    camera = view.intrinsics
    if view.grey is None:
        return Keypoints(
            np.zeros((0, 2)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 128), np.float32), camera.fx
        )
    grey = cv2.resize(view.grey, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
    found, descriptors = cv2.SIFT_create(MOST).detectAndCompute(grey, None)
    uv = (np.array([point.pt for point in found]).reshape(-1, 2) + 0.5) / ENLARGED - 0.5
    column, row = np.clip(np.rint(uv), 0, (camera.width - 1, camera.height - 1)).astype(int).T
    depth = np.nan_to_num(view.xyz[row, column, 2]).astype(float)
    depth = np.where(depth < farthest, depth, 0.0)
    rays = (uv - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    xyz = np.column_stack([rays * depth[:, None], depth])
    facing = (view_normals(view.xyz) if normals is None else normals)[row, column] * (depth > 0.0)[:, None]
    described = np.zeros((0, 128), np.float32) if descriptors is None else descriptors
    lengths = np.maximum(np.linalg.norm(described, axis=1, keepdims=True), 1e-9)
    return Keypoints(rays, xyz, facing.astype(float), np.asarray(described / lengths, np.float32), camera.fx)


class KeypointMatches(NamedTuple):
    """M matches: keypoint ``a[k]`` of ``source`` looks most alike ``b[k]`` of ``target``, and the other way round."""

    source: Keypoints
    target: Keypoints
    a: Array
    b: Array

    def __len__(self) -> int:
        return len(self.a)

    def turned(self) -> KeypointMatches:
        """The same from target to source."""
        return KeypointMatches(self.target, self.source, self.b, self.a)


def match_keypoints(source: Keypoints, target: Keypoints, ratio: float = RATIO) -> KeypointMatches:
    """The keypoints that are each other's nearest by descriptor.

    The second nearest is farther by more than 1 / ``ratio`` (Lowe, 2004).
    """
    if len(source) < 2 or len(target) < 2:
        return KeypointMatches(source, target, np.zeros(0, int), np.zeros(0, int))
    distances, nearest = _nearest(source.descriptors, target.descriptors, 2)
    each_other = _nearest(target.descriptors, source.descriptors, 1)[1][nearest[:, 0], 0] == np.arange(len(source))
    first, second = np.maximum(distances, LEAST_DISTANCE).T
    chosen = np.flatnonzero(each_other & (first < ratio * second))
    return KeypointMatches(source, target, chosen, nearest[chosen, 0])


def _nearest(one: Array, other: Array, count: int) -> tuple[Array, Array]:
    """Distances and indices (N, count) of the nearest descriptors, the nearest first.

    A matrix product would be no faster, and waits for threads of BLAS where the cores are busy: 24 ms for 2.
    """
    return cv2.batchDistance(one, other, cv2.CV_32F, None, None, cv2.NORM_L2, count)
