# SPDX-License-Identifier: Apache-2.0
"""Which way is up on a map, and how high its floor is."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import pose, rotate, rotation_between, transform

LEVEL_DEG = 3.0  # a map whose z is upright within this stays as it is: gravity in pictures errs by a degree
UPRIGHT = np.cos(np.radians(10.0))  # least z of the normal of what is horizontal
BIN_M = 0.02
HALF = 2  # bins on either side of a height that are taken for the same surface
LEAST_SHARE = 0.2  # of the area of the largest surface that the floor has: less may be a mirror, or what noise makes
NEIGHBOURS = 2  # pixels between the points that a normal is made of
JUMP = 0.1  # share of its depth by which points of one surface differ at most over that


def upright(seen: Iterable[tuple[Array, Array | None, float]]) -> Array | None:
    """``T_level_map (4, 4)`` that turns a map so that z is up, by the smallest turn; None where gravity is not known.

    ``seen`` are ``T_map_camera``, gravity (3,) in that camera or None, and its confidence 0..1. The identity for a map
    that is level within `LEVEL_DEG`.
    """
    up = np.zeros(3)
    for T_map_camera, gravity, confidence in seen:
        if gravity is not None:
            up -= confidence * rotate(T_map_camera, gravity)
    length = float(np.linalg.norm(up))
    if length < 1e-9:
        return None
    if up[2] / length >= np.cos(np.radians(LEVEL_DEG)):
        return np.eye(4)
    return pose(rotation_between(up, np.array([0.0, 0.0, 1.0])), np.zeros(3))


class Heights:
    """How much horizontal surface that faces up is at which height of a level map."""

    def __init__(self) -> None:
        self._areas: defaultdict[int, float] = defaultdict(float)  # m^2 by the number of the bin

    def add_view(self, T_level_camera: Array, view: View) -> None:
        """Count what a view shows of it."""
        xyz = view.xyz.astype(float)
        middle = xyz[NEIGHBOURS:-NEIGHBOURS, NEIGHBOURS:-NEIGHBOURS]
        right = xyz[NEIGHBOURS:-NEIGHBOURS, 2 * NEIGHBOURS :] - xyz[NEIGHBOURS:-NEIGHBOURS, : -2 * NEIGHBOURS]
        down = xyz[2 * NEIGHBOURS :, NEIGHBOURS:-NEIGHBOURS] - xyz[: -2 * NEIGHBOURS, NEIGHBOURS:-NEIGHBOURS]
        across = np.cross(down, right)  # towards the camera; as long as the area of four times NEIGHBOURS^2 pixels
        length = np.linalg.norm(across, axis=-1)
        with np.errstate(invalid="ignore"):
            smooth = np.maximum(np.abs(right[..., 2]), np.abs(down[..., 2])) < JUMP * middle[..., 2]
            flat = smooth & (length > 0.0) & (rotate(T_level_camera, across)[..., 2] > UPRIGHT * length)
        bins = np.floor(transform(T_level_camera, middle[flat])[:, 2] / BIN_M).astype(np.int64)
        areas = length[flat] / (4.0 * NEIGHBOURS**2)
        numbers, at = np.unique(bins, return_inverse=True)
        for number, area in zip(numbers.tolist(), np.bincount(at, areas, len(numbers)).tolist(), strict=True):
            self._areas[number] += area

    def floor(self) -> float | None:
        """The height in m of the lowest large surface; None where no surface is seen from above."""
        if not self._areas:
            return None
        around = {n: self._around(n) for n in sorted(self._areas)}
        enough = LEAST_SHARE * max(around.values())
        lowest = next(n for n, area in around.items() if area >= enough)
        best = max(range(lowest, lowest + 2 * HALF + 1), key=self._around)
        near = {n: self._areas.get(n, 0.0) for n in range(best - HALF, best + HALF + 1)}
        return BIN_M * sum((n + 0.5) * area for n, area in near.items()) / sum(near.values())

    def _around(self, number: int) -> float:
        return sum(self._areas.get(n, 0.0) for n in range(number - HALF, number + HALF + 1))
