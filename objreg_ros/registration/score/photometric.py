# SPDX-License-Identifier: Apache-2.0
"""How well the grey of two views correlates where one is laid into the other's image.

The same print seen from two sides has another size and another shape in either picture, so what a high pass leaves of
it in the one is not what it leaves in the other. So each view is drawn into the other's image first, through the depth,
and both are high-passed there, by the same window over the same pixels. Each pixel is divided by the contrast in its
window too: else the few strong edges between a dark floor and a bright table decide, which are alike in many rooms.
"""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse
from objreg_ros.native import kernels
from objreg_ros.registration.prepare.views import SMOOTH, Sight
from objreg_ros.registration.score.free_space import SUM_A, SUM_AA, SUM_B, SUM_BB, correlation
from objreg_ros.sensor import depth_tolerance

_KERNELS = kernels("photometric")
WINDOW = 15  # px: its mean is the slow part of grey; a wide one separates rooms best
NARROW = 9  # px: sees best that a pose was perturbed
OURS, THEIRS = [SUM_A, SUM_AA], [SUM_B, SUM_BB]


def correlate_views(source: Sight, target: Sight, T_target_source: Array) -> float:
    """The correlation -1..1 over what both see, both ways; 0 where that is next to nothing. Both must have grey."""
    forward = compare(source, target, T_target_source)
    backward = compare(target, source, inverse(T_target_source))
    backward[OURS + THEIRS] = backward[THEIRS + OURS]  # the source's grey first: one picture may have more contrast
    return correlation(forward + backward)


def compare(asked: Sight, seen: Sight, T_seen_asked: Array, window: int = WINDOW) -> Array:
    """The sums (10,) of `free_space.count` for a correlation, over the pixels of ``seen`` that ``asked`` meets."""
    slops = depth_tolerance(asked.noise, seen.noise)
    laid = _KERNELS.laid(asked.grey.points, asked.grey.shades, T_seen_asked, seen.near, seen.far, seen.camera, slops)
    return np.asarray(_KERNELS.sums(cv2.GaussianBlur(laid, (0, 0), SMOOTH), seen.grey.detail, window))
