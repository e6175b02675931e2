# SPDX-License-Identifier: Apache-2.0
"""What of an object a reader of a run sees in its picture: an outline of a few corners."""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics

UNITS = 1000  # of the width of a picture: outlines are in whole thousandths of it
SLACK = 4  # thousandths that a corner may be off
LEAST_Z = 0.05  # m


def outline(xyz: Array, camera: Intrinsics) -> str:
    """The convex outline of points ``xyz (M, 3)`` m in the picture: "u,v u,v …" in thousandths of the picture's width.

    As SVG takes the points of a polygon. Empty where fewer than three corners are left.
    """
    x, y, z = xyz[xyz[:, 2] > LEAST_Z].astype(np.float64).T
    pixels = np.column_stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])
    inside = np.clip(pixels, 0.0, (camera.width - 1, camera.height - 1)) * (UNITS / camera.width)
    if len(inside) < 3:
        return ""
    hull = cv2.approxPolyDP(cv2.convexHull(inside.round().astype(np.int32)), SLACK, closed=True)[:, 0]
    return " ".join(f"{u},{v}" for u, v in hull.tolist()) if len(hull) >= 3 else ""


def field_of_view_deg(camera: Intrinsics) -> tuple[float, float]:
    """The width and the height of what a camera sees, degrees."""
    halves = (camera.width / (2.0 * camera.fx), camera.height / (2.0 * camera.fy))
    horizontal, vertical = (round(float(np.degrees(2.0 * np.arctan(half))), 1) for half in halves)
    return horizontal, vertical
