# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a camera_info by itself, and beside another one, before anything moves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from objreg_ros.bridge.messages import camera_from_msg
from objreg_ros.plausibility import findings
from objreg_ros.plausibility.finding import Finding
from objreg_ros.plausibility.pinhole import differ, implausible


def check_camera(camera_info: Any, colour_info: Any = None, one_frame: bool = False) -> list[Finding]:
    """What a CameraInfo of depth says that cannot be; ``colour_info`` is that of colour, where there is another.

    ``one_frame`` is whether the two pictures are in one frame, so that depth is registered. ValueError for a camera
    that is not calibrated.
    """
    return [*_matrices(camera_info), *(_beside(camera_info, colour_info) if one_frame and colour_info else ())]


def _matrices(camera_info: Any) -> Iterator[Finding]:
    used, k = camera_from_msg.intrinsics(camera_info), camera_from_msg.disagreeing_k(camera_info)
    if k is not None:
        yield findings.matrices_disagree(camera_from_msg.pinhole(camera_info, "p"), k, differ(used, k))
    if why := implausible(used):
        yield findings.no_camera(why)


def _beside(camera_info: Any, colour_info: Any) -> Iterator[Finding]:
    depth, colour = camera_from_msg.intrinsics(camera_info), camera_from_msg.intrinsics(colour_info)
    if (depth.width, depth.height) == (colour.width, colour.height) and differ(depth, colour):
        yield findings.cameras_disagree(depth, colour)
