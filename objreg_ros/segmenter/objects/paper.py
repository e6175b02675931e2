# SPDX-License-Identifier: Apache-2.0
"""The founding filter, for comparison: each box is cut out, passed through depth and height limits, and loses its
largest plane (RANSAC, by Open3D). The largest plane of a crop is often the object itself.
"""

from __future__ import annotations

import threading

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects.boxes import Box
from objreg_ros.segmenter.objects.extract import Pixels
from objreg_ros.segmenter.params import SegmenterParams

PLANE_DISTANCE = 0.01  # metres
DRAWS = 200
SEED = 0
_SEEDED = threading.Lock()  # Open3D's generator is one for all threads, and boxes are cut on two


def cut(image: DepthImage, box: Box, params: SegmenterParams) -> Pixels:
    """The pixels of ``box`` that pass the filter, without normals; none where fewer than `min_points` are left."""
    x0, y0, x1, y1 = box
    camera = image.intrinsics
    z_min, z_max, y_max = params.limits
    z = image.depth[y0:y1, x0:x1]
    with np.errstate(invalid="ignore"):  # depth may be infinite
        x = z * ((np.arange(x0, x1) - camera.cx) / camera.fx).astype(np.float32)[None, :]
        y = z * ((np.arange(y0, y1) - camera.cy) / camera.fy).astype(np.float32)[:, None]
        passed = (z > z_min) & (z < z_max) & (np.abs(y) < y_max)
    v, u = np.nonzero(passed)
    xyz = np.stack([x[passed], y[passed], z[passed]], axis=-1)
    kept = _off_plane(xyz) if len(xyz) >= params.min_points else np.zeros(len(xyz), bool)
    xyz, u, v = xyz[kept], u[kept] + x0, v[kept] + y0
    area = float((xyz[:, 2] ** 2).sum()) / (camera.fx * camera.fy)
    bounds = (int(u.min()), int(v.min()), int(u.max()) + 1, int(v.max()) + 1) if len(u) > 0 else (x0, y0, x0, y0)
    rgb = None if image.rgb is None else image.rgb[v, u]
    return Pixels(xyz, np.zeros_like(xyz), rgb, np.zeros(len(xyz), np.uint16), area, bounds)


def _off_plane(xyz: Array) -> Array:
    """The points (N,) bool that are not on the largest plane: RANSAC (Fischler and Bolles, 1981), a fixed seed.

    Probability 1 ends no search early: which thread of Open3D finds a good plane first would decide the result.
    """
    import open3d as o3d

    off = np.ones(len(xyz), bool)
    if len(xyz) < 3:
        return off
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz.astype(float)))
    with _SEEDED:
        o3d.utility.random.seed(SEED)
        _, on_plane = cloud.segment_plane(PLANE_DISTANCE, ransac_n=3, num_iterations=DRAWS, probability=1.0)
    off[on_plane] = False
    return off
