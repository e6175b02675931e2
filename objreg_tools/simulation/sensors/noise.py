# SPDX-License-Identifier: Apache-2.0
"""Depth with the errors of a structured-light sensor: noise, steps, shadows, lost and mixed pixels.

The axial noise is that of Nguyen, Izadi and Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and
tracking" (2012): 0.0012 + 0.0019 (z - 0.4)^2 metres. It is correlated between neighbours, more along a row than across,
as that of real Kinect clouds is, because the sensor matches windows of several pixels. Steps grow with the square of
depth, because disparity is measured in eighths of a pixel. Points that the projector does not reach (it sits a baseline
to the right) have no depth, nor have blotches of surfaces that shine. Other sensors: `active_stereo`, `time_of_flight`.
"""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_tools.simulation.params import DepthParams, StressParams
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.surfaces import Surfaces

_KERNELS = kernels("noise")


def warp_field(seed: int, shape: tuple[int, int], strength: float) -> Array:
    """(H, W) float32: a smooth random field of standard deviation ``strength``, waves of about a sixth of the image."""
    if strength == 0:
        return np.zeros(shape, np.float32)
    coarse = np.random.default_rng([seed, 7]).standard_normal((7, 9)).astype(np.float32)
    field = cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)
    return (field * (strength / field.std())).astype(np.float32)


class DepthSensor:
    """The sensor for one image: knows its parameters and its seed, measures any rows."""

    def __init__(
        self, params: DepthParams, stress: StressParams, seed: int, shape: tuple[int, int], surfaces: Surfaces
    ) -> None:
        self.loss = surfaces.loss
        p = params
        values = (p.noise_floor, p.noise_growth, p.quantum, p.baseline, p.near, p.far, p.dropout, p.grazing_cosine)
        edges = (p.edge_jitter + stress.ragged, p.edge_dropout, p.mixed, stress.depth_bias)
        self.numbers = tuple(np.float32(v) for v in (*values, *edges))
        self.warp = warp_field(seed, shape, stress.warp)
        self.seed = np.uint64(int(np.random.default_rng([seed, 11]).integers(2**62)))

    def sense(
        self, projection: Projection, nearness: Array, triangle: Array, rows: tuple[int, int], depth: Array
    ) -> None:
        """Measure ``rows`` of ``depth (H, W) float32`` m, 0 where nothing is, from the rasteriser's buffers."""
        i = projection.intrinsics
        camera = tuple(np.float32(v) for v in (i.fx, i.fy, i.cx, i.cy))
        _KERNELS.sense(
            nearness, triangle, projection.inverse_depth, self.loss, *rows, camera, self.numbers, self.seed, self.warp,
            depth,
        )  # fmt: skip
