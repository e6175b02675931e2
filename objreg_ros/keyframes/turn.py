# SPDX-License-Identifier: Apache-2.0
"""How far a camera turned between two frames, from small blurred pictures: a first guess where it turns fast.

The pictures are aligned by a rotation alone, which is most of what moves a picture from one frame to the next (Klein
and Murray, "Improving the agility of keyframe-based SLAM", 2008). No depth is used, so none is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import pose, rotation_angle, rotation_from_vector
from objreg_ros.native import kernels

_KERNELS = kernels("turn")
WIDTHS = (20, 40)  # px of the pictures, coarse to fine
BLUR = 1.2  # px, one sigma
ITERATIONS = 8
LEAST_OVERLAP = 0.3  # of the picture; what overlaps less is not compared
SETTLED = 1e-3  # rad
MOST_DIFFERENT, NOISE = 0.3, 1.0  # share of a picture's contrast, and grey levels, that a turn leaves unexplained
FEW_PX = 6.0  # of a view, by which a turn may move it and mostly be found from rest


class Turn(NamedTuple):
    """``T_last_frame (4, 4)``, a turn alone; None where none makes one picture the other, or there is no grey.

    ``is_fast``: it moved the view by more than `FEW_PX`.
    """

    T_last_frame: Array | None = None
    is_fast: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class SmallPicture:
    """A blurred ``grey (h, w)`` with its ``slope (h, w, 2)``, float32, and its ``camera``, fx fy cx cy."""

    grey: Array
    slope: Array
    camera: Array


def small_pictures(view: View) -> tuple[SmallPicture, ...]:
    """A view's pictures, the smallest first; none of a view without grey."""
    return () if view.grey is None else tuple(_small(view, view.grey, width) for width in WIDTHS)


def _small(view: View, grey: Array, width: int) -> SmallPicture:
    k = view.intrinsics
    size = width, max(round(width * k.height / k.width), 2)
    small = cv2.resize(grey.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), BLUR)
    x, y = size[0] / k.width, size[1] / k.height
    camera = np.array([k.fx * x, k.fy * y, (k.cx + 0.5) * x - 0.5, (k.cy + 0.5) * y - 0.5])
    slope = np.stack((np.gradient(small, axis=1), np.gradient(small, axis=0)), axis=-1)
    return SmallPicture(small, slope, camera)


def turn_between(
    source: tuple[SmallPicture, ...], target: tuple[SmallPicture, ...], R_target_source: Array | None = None
) -> tuple[Array, float]:
    """``R_target_source (3, 3)`` from a guess (none, if None), and by how many grey levels the pictures differ then.

    The latter is a root mean square, inf where they do not overlap.
    """
    R, difference = np.eye(3) if R_target_source is None else R_target_source.copy(), np.inf
    for one, other in zip(source, target, strict=True):
        for _ in range(ITERATIONS):
            seen = (one.grey, one.camera, R, other.grey, other.slope, other.camera)
            H, g, difference, overlap = _KERNELS.equations(*seen)
            if overlap < LEAST_OVERLAP:
                return R, np.inf
            step = -np.linalg.solve(H + 1e-6 * np.trace(H) * np.eye(4) + 1e-9 * np.eye(4), g)
            R = rotation_from_vector(step[:3]) @ R
            if np.abs(step[:3]).max() < SETTLED:
                break
    return R, float(difference)


class LastPicture:
    """The small pictures of the last frame of a stream, against which the next one is looked at."""

    def __init__(self) -> None:
        self._pictures: tuple[SmallPicture, ...] = ()

    def set_first(self, view: View) -> None:
        """Take the first frame."""
        self._pictures = small_pictures(view)

    def next(self, view: View) -> Turn:
        """How the camera turned since the last frame, which this one is from now on."""
        last, self._pictures = self._pictures, small_pictures(view)
        if not last or not self._pictures:
            return Turn()
        R, difference = turn_between(self._pictures, last)
        if not difference <= MOST_DIFFERENT * np.std(self._pictures[-1].grey) + NOISE:
            return Turn()
        pixels = rotation_angle(R) * max(view.intrinsics.fx, view.intrinsics.fy)
        return Turn(pose(R, np.zeros(3)), pixels > FEW_PX)
