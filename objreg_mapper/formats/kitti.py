# SPDX-License-Identifier: Apache-2.0
"""A trajectory in the text of the KITTI odometry benchmark: the upper three rows of each pose, and no stamps."""

from __future__ import annotations

from collections.abc import Iterable

from objreg_ros.data.checked import Array


def trajectory_text(poses: Iterable[Array]) -> str:
    """The file: a line of twelve numbers for each ``T_map_body (4, 4)``, row by row without the last; m."""
    return "".join(" ".join(f"{value:z.9f}" for value in T[:3].flat) + "\n" for T in poses)
