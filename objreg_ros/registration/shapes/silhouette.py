# SPDX-License-Identifier: Apache-2.0
"""The outline of an object as one camera saw it, drawn finer than the view, with what the view saw beside and behind.

Points of another sighting that fall beside the outline float in space that was seen to be free, unless something stands
in front. That separates front from back and refuses turns that fit the points well: the reduced view is too coarse for
it, but the object's own points are not.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.native import kernels
from objreg_ros.sensor import silhouette_tolerance

_KERNELS = kernels("silhouette")
BESIDE, INSIDE, RIM = 0, 1, 2  # the values of a silhouette's mask
FINEST = 4.0  # pixels of a silhouette for one of the view
MARGIN = 6  # px around the object


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Silhouette:
    """A window of a virtual camera: ``depth (h, w) float32`` m of the object inside and of what is behind beside it.

    0 where nothing was measured; ``mask (h, w) uint8`` is BESIDE, INSIDE or RIM (too close to decide); ``grey (h, w)
    float32`` is the object's own; ``camera (4,) float64`` fx fy cx cy of the window; ``tolerance (2,)`` is the camera's
    `silhouette_tolerance`.

    ``inward (h, w, 2) int16`` px leads from each pixel to the nearest inside; ``edges (4,) bool`` says which sides of
    the window, left, top, right and bottom, are those of the whole picture: nothing is known beyond.
    """

    depth: Array
    mask: Array
    grey: Array
    camera: Array
    tolerance: Array
    inward: Array
    edges: Array


def draw(xyz: Array, grey: Array, view: View, noise: float = 1.0) -> Silhouette:
    """The silhouette of points (N, 3) with ``grey (N,) float32``, seen by the camera of ``view``; N at least 1.

    ``noise`` is the `depth_noise` of that camera.
    """
    scale = _scale(xyz, view)
    camera = view.intrinsics
    lens = np.array([camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5]) * scale
    u, v = (lens[k] * xyz[:, k].astype(float) / xyz[:, 2] + lens[2 + k] for k in (0, 1))
    left, top = (max(0, int(np.floor(c.min())) - MARGIN) for c in (u, v))
    width, height = (int(np.ceil(n * scale)) for n in (camera.width, camera.height))
    right, bottom = min(width, int(u.max()) + MARGIN + 1), min(height, int(v.max()) + MARGIN + 1)
    shape = max(bottom - top, 1), max(right - left, 1)
    depth, shade = np.full(shape, np.inf, np.float32), np.zeros(shape, np.float32)
    _KERNELS.splat(u - left, v - top, xyz[:, 2], grey, depth, shade)
    mask, depth, shade = _closed(depth, shade)
    near = cv2.dilate(mask, np.ones((3, 3), np.uint8), iterations=max(1, round(scale / 2)))
    behind = _background(view, mask, scale, (left, top))
    lens[2:] -= left, top
    return Silhouette(
        depth=np.where(mask > 0, depth, behind),
        mask=np.where(mask > 0, INSIDE, np.where(near > 0, RIM, BESIDE)).astype(np.uint8),
        grey=shade,
        camera=lens,
        tolerance=silhouette_tolerance(noise),
        inward=_inward(mask),
        edges=np.array([left == 0, top == 0, right == width, bottom == height]),
    )


def _inward(mask: Array) -> Array:
    """(h, w, 2) int16: columns and rows from each pixel to the nearest that the mask (h, w) holds; 0 without any."""
    if not mask.any():
        return np.zeros((*mask.shape, 2), np.int16)
    _, nearest = cv2.distanceTransformWithLabels(1 - mask, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    return np.asarray(_KERNELS.ways(mask, nearest, int(nearest.max()) + 1))


def _scale(xyz: Array, view: View) -> float:
    """Pixels of the silhouette for one of the view, so that about one point falls into each."""
    camera = view.intrinsics
    column = (camera.fx * xyz[:, 0] / xyz[:, 2] + camera.cx + 0.5).astype(np.int64)
    row = (camera.fy * xyz[:, 1] / xyz[:, 2] + camera.cy + 0.5).astype(np.int64)
    covered = len(np.unique(row * 65536 + column))
    return float(np.clip(np.sqrt(len(xyz) / covered), 1.0, FINEST))


def _closed(depth: Array, shade: Array) -> tuple[Array, Array, Array]:
    """(mask, depth, shade) with the gaps between points filled by the mean of their neighbours."""
    hit = np.isfinite(depth)
    mask = cv2.morphologyEx(hit.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8), iterations=2)
    weight = cv2.boxFilter(hit.astype(np.float32), -1, (5, 5), normalize=False, borderType=cv2.BORDER_CONSTANT)
    gaps = (mask > 0) & ~hit & (weight > 0)
    for image in (depth, shade):
        image[~hit] = 0.0
        mean = cv2.boxFilter(image, -1, (5, 5), normalize=False, borderType=cv2.BORDER_CONSTANT)
        image[gaps] = mean[gaps] / weight[gaps]
    return (hit | gaps).astype(np.uint8), depth, shade


def _background(view: View, mask: Array, scale: float, corner: tuple[int, int]) -> Array:
    """(h, w) float32: what the view measured at each pixel of the window but for the object; 0 for nothing.

    The object's own pixels, and their neighbours, take the depth of the nearest that is not.
    """
    rows, columns = (
        np.clip(((np.arange(n) + first + 0.5) / scale).astype(np.int64), 0, most - 1)
        for n, first, most in zip(mask.shape, corner[::-1], view.xyz.shape[:2], strict=True)
    )
    top, left = rows[0], columns[0]
    seen = np.nan_to_num(view.xyz[top : rows[-1] + 1, left : columns[-1] + 1, 2], nan=0.0)
    own = np.zeros(seen.shape, np.uint8)
    hit = np.nonzero(mask)
    own[rows[hit[0]] - top, columns[hit[1]] - left] = 1
    if not own.all():
        _, nearest = cv2.distanceTransformWithLabels(own, cv2.DIST_L1, 3, labelType=cv2.DIST_LABEL_PIXEL)
        lookup = np.zeros(int(nearest.max()) + 1, np.float32)
        lookup[nearest[own == 0]] = seen[own == 0]
        seen = np.where(own > 0, lookup[nearest], seen)
    return np.ascontiguousarray(seen[np.ix_(rows - top, columns - left)], np.float32)
