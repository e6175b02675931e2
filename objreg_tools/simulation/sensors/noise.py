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
import numba as nb
import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.params import DepthParams, StressParams
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.surfaces import Surfaces

JUMP_SHARE = 0.02
"""Neighbours whose depths differ by more than this share are an edge."""
LATTICE_PX = 3
"""Edges wander together over about as many pixels."""
NOISE_CELL_PX = (3, 6)
"""Rows and columns over which noise is alike."""
WHITE_SHARE = 0.1
"""Share of the noise's variance that differs from pixel to pixel."""
BLOTCH_PX = 24
"""Size of the holes in surfaces that reflect badly."""


@nb.njit(cache=True, nogil=True, inline="always")
def mixed_bits(a, b):  # type: ignore[no-untyped-def]
    """64 well mixed bits of two numbers (the finaliser of splitmix64, Steele et al. 2014)."""
    h = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) * np.uint64(0xD1B54A32D192ED03)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return h ^ (h >> np.uint64(31))


@nb.njit(cache=True, nogil=True, inline="always")
def normal(bits):  # type: ignore[no-untyped-def]
    """A nearly normal number from 64 bits: the sum of four uniform ones (Irwin-Hall), standard deviation 1."""
    low = np.uint64(0xFFFF)
    total = (bits & low) + ((bits >> np.uint64(16)) & low) + ((bits >> np.uint64(32)) & low) + (bits >> np.uint64(48))
    return (np.float32(total) * np.float32(1 / 65535.0) - np.float32(2.0)) * np.float32(1.7320508)


@nb.njit(cache=True, nogil=True, inline="always")
def uniform(bits):  # type: ignore[no-untyped-def]
    """A number 0..1 from the upper 24 of 64 bits."""
    return np.float32(bits >> np.uint64(40)) * np.float32(1 / 16777216.0)


@nb.njit(cache=True, nogil=True)
def _wander(seed, y, x):  # type: ignore[no-untyped-def]
    """A smooth random number of standard deviation about 1 at a pixel: bilinear between those of a lattice."""
    cell = LATTICE_PX
    i, j = y // cell, x // cell
    a, b = np.float32(y - i * cell) / cell, np.float32(x - j * cell) / cell
    g00, g01 = normal(mixed_bits(seed, i * 8192 + j)), normal(mixed_bits(seed, i * 8192 + j + 1))
    g10, g11 = normal(mixed_bits(seed, (i + 1) * 8192 + j)), normal(mixed_bits(seed, (i + 1) * 8192 + j + 1))
    one = np.float32(1)
    return ((one - a) * ((one - b) * g00 + b * g01) + a * ((one - b) * g10 + b * g11)) * np.float32(1.5)


@nb.njit(cache=True, nogil=True)
def _noise_row(seed, y, cell_y, out):  # type: ignore[no-untyped-def]
    """Lattice values for row ``y`` of smooth noise, one for each column of the lattice. Variance about 1."""
    i = y // cell_y
    a = np.float32(y - i * cell_y) / np.float32(cell_y)
    for j in range(out.shape[0]):
        low, high = normal(mixed_bits(seed, i * 8192 + j)), normal(mixed_bits(seed, (i + 1) * 8192 + j))
        # linear interpolation in both directions takes 2/3 of the deviation away
        out[j] = ((np.float32(1) - a) * low + a * high) * np.float32(1.5)


@nb.njit(cache=True, nogil=True, inline="always")
def _at(row, x, cell):  # type: ignore[no-untyped-def]
    """The value of a noise row at column ``x``."""
    j = x // cell
    b = np.float32(x - j * cell) / np.float32(cell)
    return (np.float32(1) - b) * row[j] + b * row[j + 1]


@nb.njit(cache=True, nogil=True)
def _shadow_row(nearness, y, shift, out):  # type: ignore[no-untyped-def]
    """Mark the pixels of a row that the projector does not reach; ``shift`` is focal length times baseline.

    A point at column x lies in the projector's column x - shift / z. Going left, that column must fall; where it does
    not, something nearer and further right stands in the projector's ray.
    """
    least = np.float32(1e9)
    for x in range(nearness.shape[1] - 1, -1, -1):
        column = np.float32(x) - shift * nearness[y, x]
        out[x] = column > least + np.float32(0.5)
        if column < least:
            least = column


@nb.njit(cache=True, nogil=True, inline="always")
def _surroundings(nearness, y, x):  # type: ignore[no-untyped-def]
    """Least and greatest 1/z two pixels away, and by how much 1/z bends here: a plane does not, however slanted."""
    height, width = nearness.shape
    left, right = nearness[y, max(x - 2, 0)], nearness[y, min(x + 2, width - 1)]
    above, below = nearness[max(y - 2, 0), x], nearness[min(y + 2, height - 1), x]
    twice = 2 * nearness[y, x]
    bend = max(abs(left + right - twice), abs(above + below - twice))
    return min(min(left, right), min(above, below)), max(max(left, right), max(above, below)), bend


@nb.njit(cache=True, nogil=True, inline="always")
def _wandered(seed, y, x, jitter, shape):  # type: ignore[no-untyped-def]
    """The pixel whose depth is measured at an edge pixel: one nearby, and nearby for the neighbours too."""
    xx = min(max(x + int(np.rint(jitter * _wander(seed + 1, y, x))), 0), shape[1] - 1)
    yy = min(max(y + int(np.rint(jitter * _wander(seed + 2, y, x))), 0), shape[0] - 1)
    return yy, xx


@nb.njit(cache=True, nogil=True, inline="always")
def _facing(nearest, inverse_depth, f, fx, fy, dx, dy):  # type: ignore[no-untyped-def]
    """The cosine between the ray (dx, dy, 1) and the normal of face f, from the face's plane in 1/z."""
    a, b = inverse_depth[f, 1] * fx, inverse_depth[f, 2] * fy
    c = nearest - a * dx - b * dy
    return nearest / np.sqrt((a * a + b * b + c * c) * (np.float32(1.0) + dx * dx + dy * dy))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _sense(  # type: ignore[no-untyped-def]
    nearness, triangle, inverse_depth, loss, y_first, y_last, camera, numbers, seed, warp, depth
):  # fmt: skip
    """Measure the rows y_first..y_last of ``depth``; see `DepthSensor`. ``numbers`` are the parameters in order."""
    fx, fy, cx, cy = camera
    floor, growth, quantum, baseline, near, far, dropout, grazing, jitter, edge_dropout, mixed, bias = numbers
    width = nearness.shape[1]
    shadow = np.zeros(width, np.bool_)
    one, jump = np.float32(1.0), np.float32(JUMP_SHARE)
    cell_y, cell_x = NOISE_CELL_PX
    smooth = np.empty(width // cell_x + 2, np.float32)
    blotch = np.empty(width // BLOTCH_PX + 2, np.float32)
    common, single = np.float32(np.sqrt(1 - WHITE_SHARE)), np.float32(np.sqrt(WHITE_SHARE))
    for y in range(y_first, y_last):
        _shadow_row(nearness, y, fx * baseline, shadow)
        _noise_row(seed + 6, y, cell_y, smooth)
        _noise_row(seed + 7, y, BLOTCH_PX, blotch)
        dy = (np.float32(y) - cy) / fy
        for x in range(width):
            depth[y, x] = 0
            nearest = nearness[y, x]
            if nearest <= 0 or shadow[x]:
                continue
            at = y * width + x
            bits = mixed_bits(seed, at)
            low, high, bend = _surroundings(nearness, y, x)
            yy, xx = y, x
            if bend > jump * nearest and high - low > jump * nearest:
                luck = uniform(mixed_bits(seed + 3, at))
                yy, xx = _wandered(seed, y, x, jitter, nearness.shape)
                if luck < edge_dropout or nearness[yy, xx] <= 0:
                    continue
                nearest = nearness[yy, xx]
                if luck > one - mixed:
                    share = uniform(mixed_bits(seed + 4, at))
                    nearest = one / (share / max(low, np.float32(0.05)) + (one - share) / high)
            f = triangle[yy, xx]
            cosine = _facing(nearness[yy, xx], inverse_depth, f, fx, fy, (np.float32(x) - cx) / fx, dy)
            lost = dropout + max(np.float32(0.0), (grazing - cosine) * np.float32(5.0))
            if uniform(mixed_bits(seed + 5, at)) < lost:
                continue
            if loss[f] > 0:  # in blotches: the logistic curve makes normal numbers nearly uniform
                level = _at(blotch, x, BLOTCH_PX) + np.float32(0.4) * normal(mixed_bits(seed + 8, at))
                if one / (one + np.exp(np.float32(-1.6) * level)) < loss[f]:
                    continue
            z = one / nearest
            error = common * _at(smooth, x, cell_x) + single * normal(bits)
            beyond = z - np.float32(0.4)
            z = z * (one + bias) + warp[y, x] * z * z + error * (floor + growth * beyond * beyond)
            if quantum > 0:  # equal steps of disparity, that is of 1/z
                z = one / (max(np.rint(one / (z * quantum)), one) * quantum)
            if near <= z <= far:
                depth[y, x] = z


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
        _sense(
            nearness,
            triangle,
            projection.inverse_depth,
            self.loss,
            *rows,
            camera,
            self.numbers,
            self.seed,
            self.warp,
            depth,
        )
