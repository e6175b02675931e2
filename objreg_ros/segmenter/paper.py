# SPDX-License-Identifier: Apache-2.0
"""The founding filter, for comparison: each box is cut out, passed through depth and height limits, and loses its
largest plane (RANSAC). The largest plane of a crop is often the object itself.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array, DepthImage
from objreg_ros.segmenter.boxes import Box
from objreg_ros.segmenter.extract import Pixels
from objreg_ros.segmenter.params import SegmenterParams

PLANE_DISTANCE = 0.01  # metres
DRAWS = 200


def cut(image: DepthImage, box: Box, params: SegmenterParams) -> Pixels:
    """The pixels of ``box`` that pass the filter, without normals; none where fewer than `min_points` are left."""
    x0, y0, x1, y1 = box
    camera = image.intrinsics
    z_max, y_max = params.limits
    z = image.depth[y0:y1, x0:x1]
    with np.errstate(invalid="ignore"):  # depth may be infinite
        x = z * ((np.arange(x0, x1) - camera.cx) / camera.fx).astype(np.float32)[None, :]
        y = z * ((np.arange(y0, y1) - camera.cy) / camera.fy).astype(np.float32)[:, None]
        passed = (z > params.z_min) & (z < z_max) & (np.abs(y) < y_max)
    v, u = np.nonzero(passed)
    xyz = np.stack([x[passed], y[passed], z[passed]], axis=-1)
    kept = _off_plane(xyz) if len(xyz) >= params.min_points else np.zeros(len(xyz), bool)
    xyz, u, v = xyz[kept], u[kept] + x0, v[kept] + y0
    area = float((xyz[:, 2] ** 2).sum()) / (camera.fx * camera.fy)
    bounds = (int(u.min()), int(v.min()), int(u.max()) + 1, int(v.max()) + 1) if len(u) > 0 else (x0, y0, x0, y0)
    rgb = None if image.rgb is None else image.rgb[v, u]
    return Pixels(xyz, np.zeros_like(xyz), rgb, np.zeros(len(xyz), np.uint16), area, bounds)


def _off_plane(xyz: Array) -> Array:
    """The points (N,) bool that are not on the largest plane: RANSAC (Fischler and Bolles, 1981), a fixed seed."""
    draws = np.random.default_rng(0).integers(0, len(xyz), (DRAWS, 3))
    a, b, c = xyz[draws[:, 0]], xyz[draws[:, 1]], xyz[draws[:, 2]]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals, a = normals[lengths > 1e-9] / lengths[lengths > 1e-9, None], a[lengths > 1e-9]
    if len(normals) == 0:
        return np.ones(len(xyz), bool)
    offsets = (normals * a).sum(axis=1)
    sample = xyz[:: max(1, len(xyz) // 2000)]
    counts = (np.abs(sample @ normals.T - offsets) < PLANE_DISTANCE).sum(axis=0)
    best = int(counts.argmax())
    return np.abs(xyz @ normals[best] - offsets[best]) >= PLANE_DISTANCE
