# SPDX-License-Identifier: Apache-2.0
"""Boxes: clipping, overlap, suppression of overlaps, and the offsets from priors."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array


def clip(xyxy: Array, height: float, width: float) -> Array:
    """Boxes ``(N, 4)`` cut to the image."""
    return np.clip(xyxy, 0.0, np.array([width, height, width, height], xyxy.dtype))


def area(xyxy: Array) -> Array:
    """The areas ``(N,)`` of boxes ``(N, 4)``; 0 where a box is inside out."""
    width, height = (np.maximum(xyxy[..., axis + 2] - xyxy[..., axis], 0) for axis in range(2))
    return width * height


def iou(a: Array, b: Array) -> Array:
    """Intersection over union ``(N, M)`` of boxes ``(N, 4)`` and ``(M, 4)``; 0 where both are empty."""
    shared = _shared(a, b, 0) * _shared(a, b, 1)
    union = area(a)[:, None] + area(b)[None] - shared
    return np.divide(shared, union, out=np.zeros_like(shared), where=union > 0)


def _shared(a: Array, b: Array, axis: int) -> Array:
    """How far boxes lie over each other along one axis ``(N, M)``; axes apart keep numpy's loops long and so fast."""
    low = np.maximum(a[:, None, axis], b[None, :, axis])
    high = np.minimum(a[:, None, axis + 2], b[None, :, axis + 2])
    return np.maximum(high - low, 0)


def suppress(xyxy: Array, classes: Array, same_iou: float, cross_iou: float) -> Array:
    """Which of the boxes ``(N, 4)``, sorted best first, greedy non-maximum suppression keeps: ``(N,) bool``.

    A box goes when a better kept one overlaps it by more than ``same_iou`` (same class) or ``cross_iou`` (another
    class). The greedy answer is the fixed point of one matrix operation (Cluster-NMS; Zheng et al., "Enhancing
    Geometric Factors in Model Learning and Inference", 2020).
    """
    limit = np.where(classes[:, None] == classes[None], same_iou, cross_iou)
    beats: Array = np.triu(iou(xyxy, xyxy) > limit, k=1)
    kept: Array = np.ones(len(xyxy), bool)
    for _ in range(len(xyxy)):
        still = np.logical_not((beats & kept[:, None]).any(axis=0))
        if (still == kept).all():
            break
        kept = still
    return kept


def decode(offsets: Array, priors: Array, variances: Array) -> Array:
    """Boxes x_min y_min x_max y_max ``(N, 4)`` from offsets and priors cx cy w h (Liu et al., "SSD", 2016, eq. 2)."""
    centre = priors[:, :2] + offsets[:, :2] * variances[:2] * priors[:, 2:]
    size = priors[:, 2:] * np.exp(np.minimum(offsets[:, 2:] * variances[2:], 4.0))
    return np.concatenate([centre - size / 2, centre + size / 2], axis=1)
