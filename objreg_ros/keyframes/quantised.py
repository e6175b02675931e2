# SPDX-License-Identifier: Apache-2.0
"""What a keyframe measured as whole numbers, in steps well below the noise of depth and of grey, and back.

Depths have steps of `DEPTH_STEP` of themselves, points steps of half a standard deviation of the depth at the near side
of their object, normals are octahedra (Meyer et al., "On floating-point normal vectors", 2010), colours brightness and
two differences.
"""

from __future__ import annotations

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.sensor import depth_sigma

DEPTH_STEP = 0.0008  # of the depth: 0.8 mm at 1 m, where a Kinect's noise is 1.9 mm, 2.4 mm at 3 m, where it is 14 mm
DEPTH_STEPS = np.log(limits.MOST_RANGE / limits.LEAST_RANGE) / DEPTH_STEP
GREY_STEP = 2  # grey levels
LEAST_STEP_UM, MOST_STEP_UM = 500, 2000  # of the points of an object
CONTEXT_STEP_UM = 2000  # of points that are means of voxels of 30 mm
NORMAL_STEPS = 31  # each way: 1.4 degrees of error in the mean, where those of single points err by several
BRIGHTNESS_STEP, COLOUR_STEP = 4, 8  # levels
BRIGHTNESS = np.array([0.299, 0.587, 0.114])


def depth_steps(depth: Array) -> Array:
    """(N,) whole numbers of depths (N,) m within `limits.LEAST_RANGE` and `limits.MOST_RANGE`."""
    return np.asarray(np.rint(np.log(depth / limits.LEAST_RANGE) / DEPTH_STEP), np.int64)


def depth_of(steps: Array) -> Array:
    """(N,) float32 m; what is beyond the range is at its end."""
    growth = np.exp(DEPTH_STEP * steps.clip(0, DEPTH_STEPS))
    return np.asarray(limits.LEAST_RANGE * growth, np.float32).clip(limits.LEAST_RANGE, limits.MOST_RANGE)


def grey_steps(grey: Array) -> Array:
    """(...) whole numbers of grey (...) uint8."""
    return np.asarray((grey.astype(np.int64) + GREY_STEP // 2) // GREY_STEP)


def grey_of(steps: Array) -> Array:
    """(...) uint8."""
    return np.asarray((GREY_STEP * steps).clip(0, 255), np.uint8)


def step_um(xyz: Array) -> int:
    """The step in micrometres for the points (N, 3) of an object, N at least 1."""
    half_um = 1e6 * depth_sigma(xyz[:, 2].min()) / 2.0
    return int(np.clip(half_um, LEAST_STEP_UM, MOST_STEP_UM))


def point_steps(xyz: Array, step_um: int) -> Array:
    """(N, 3) whole numbers of points (N, 3) m within `limits.MOST_RANGE`."""
    most = int(1e6 * limits.MOST_RANGE) // step_um
    return np.rint(xyz * (1e6 / step_um)).clip(-most, most).astype(np.int64)


def points_of(steps: Array, step_um: Array | int) -> Array:
    """(N, 3) float32 m, in steps of one size, or of one for each point (N, 1). ValueError beyond the range."""
    xyz = 1e-6 * step_um * steps
    farthest = float(np.abs(xyz).max(initial=0.0))
    if farthest > limits.MOST_RANGE:
        raise ValueError(f"expected points within {limits.MOST_RANGE:g} m, got one at {farthest:g} m")
    return np.asarray(xyz, np.float32)


def normal_steps(normals: Array) -> Array:
    """(N, 2) whole numbers of normals (N, 3): within `NORMAL_STEPS`, or beyond for one that is unknown."""
    size = np.abs(normals).sum(axis=1, keepdims=True)
    x, y, z = (normals / np.where(size > 0.0, size, 1.0)).T
    flat = np.stack([x, y], axis=1)
    folded = (1.0 - np.abs(flat[:, ::-1])) * np.where(flat >= 0.0, 1.0, -1.0)
    steps = np.rint(NORMAL_STEPS * np.where(z[:, None] < 0.0, folded, flat)).astype(np.int64)
    return np.where(size > 0.0, steps, NORMAL_STEPS + 1)


def normals_of(steps: Array) -> Array:
    """(N, 3) float32 of length 1, or 0 0 0 where unknown."""
    flat = steps / NORMAL_STEPS
    z = 1.0 - np.abs(flat).sum(axis=1, keepdims=True)
    unfolded = np.where(z < 0.0, (1.0 - np.abs(flat[:, ::-1])) * np.where(flat >= 0.0, 1.0, -1.0), flat)
    normals = np.concatenate([unfolded, z], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(np.abs(steps).max(axis=1, keepdims=True) > NORMAL_STEPS, 0.0, normals).astype(np.float32)


def colour_steps(rgb: Array) -> Array:
    """(N, 3) whole numbers of colours (N, 3): brightness, and by how much red and blue are above it."""
    bright = rgb @ BRIGHTNESS
    steps = bright / BRIGHTNESS_STEP, (rgb[:, 0] - bright) / COLOUR_STEP, (rgb[:, 2] - bright) / COLOUR_STEP
    return np.rint(np.stack(steps, axis=1)).astype(np.int64)


def rgb_of(steps: Array) -> Array:
    """(N, 3) uint8."""
    bright, red, blue = steps[:, 0] * BRIGHTNESS_STEP, *(steps[:, 1:].T * COLOUR_STEP)
    green = -(BRIGHTNESS[0] * red + BRIGHTNESS[2] * blue) / BRIGHTNESS[1]
    return np.rint(np.stack([bright + red, bright + green, bright + blue], axis=1)).clip(0, 255).astype(np.uint8)
