# SPDX-License-Identifier: Apache-2.0
"""Whether the numbers of a pinhole camera can be those of a depth camera at all, and which of two of them can.

Cameras that see a room have a principal point near the middle of their picture and a field of view between that of a
telephoto lens and that of a fisheye. What is cut out of a picture (a region of interest) has its principal point
elsewhere, but inside.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.images import Intrinsics

LEAST_FOCAL, MOST_FOCAL = 0.18, 2.9  # of the longer side of the picture: a field of view of 140 and of 20 degrees
MOST_ASPECT = 1.5  # between the focal lengths of columns and rows
SAME = 0.02  # of the focal length, and of the width: what two cameras that are one may differ by
NEARER = 0.1  # of the size of the picture: by so much the principal point of one of two cameras is nearer to the middle


def implausible(camera: Intrinsics) -> str:
    """Why a camera cannot be that of its picture; empty if it can."""
    size = f"{camera.width} × {camera.height}"
    if not (-0.5 <= camera.cx <= camera.width - 0.5 and -0.5 <= camera.cy <= camera.height - 0.5):
        return f"expected a principal point inside of the picture of {size}, got {camera.cx:.1f}, {camera.cy:.1f}"
    longer = max(camera.width, camera.height)
    least, most = sorted((camera.fx, camera.fy))
    if not (least >= LEAST_FOCAL * longer and most <= MOST_FOCAL * longer):
        bounds = f"{LEAST_FOCAL * longer:.0f} to {MOST_FOCAL * longer:.0f} px"
        return f"expected a focal length of {bounds} in a picture of {size}, got {camera.fx:.1f} and {camera.fy:.1f}"
    if most > MOST_ASPECT * least:
        return f"expected pixels that are about square, got focal lengths of {camera.fx:.1f} and {camera.fy:.1f}"
    return ""


def differ(one: Intrinsics, other: Intrinsics) -> bool:
    """Whether two cameras of pictures of one size are not one camera."""
    focal = max(abs(np.log(one.fx / other.fx)), abs(np.log(one.fy / other.fy)))
    centre = max(abs(one.cx - other.cx), abs(one.cy - other.cy)) / max(one.width, one.height)
    return bool(max(focal, centre) > SAME)


def likelier(one: Intrinsics, other: Intrinsics) -> Intrinsics:
    """Of two cameras that one picture is said to have, the first unless the second alone can be."""
    if implausible(one) and not implausible(other):
        return other
    return other if _aside(other) + NEARER < _aside(one) and not implausible(other) else one


def _aside(camera: Intrinsics) -> float:
    """How far the principal point is from the middle of the picture, of its size."""
    across = (camera.cx - (camera.width - 1) / 2) / camera.width
    down = (camera.cy - (camera.height - 1) / 2) / camera.height
    return float(np.hypot(across, down))
