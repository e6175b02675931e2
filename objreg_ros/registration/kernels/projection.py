# SPDX-License-Identifier: Apache-2.0
"""Kernels that project points into a camera and read its image there. Other kernels call them first.

All points are projected before any pixel is read, so that the processor projects several points at a time. The code
that follows reads a pixel first and tests its value afterwards, so that it too runs for several points at a time.
Together this takes a third of the time of one loop over the points.
"""

from __future__ import annotations

from objreg_ros.native import kernels

_KERNELS = kernels("projection")
LEAST_DEPTH = 0.1  # m: nearer points are taken for points behind the camera
between = _KERNELS.between  # (image, u, v): the bilinear value of an image (h, w) float64, its slopes along u and v
lands = _KERNELS.lands  # (u, v, z, image): whether a point is before the camera and between four pixels of an image
nearest = _KERNELS.nearest  # (u, v): the row and the column of the pixel that a place in the image is in
project = _KERNELS.project  # (points, T, camera): the pixels u, v and the depths z (N,) of points (N, 3) moved by T
spread = _KERNELS.spread  # (image, u, v, value): add a value, and its weight of 1, to four pixels of (h, w, 2) float32
