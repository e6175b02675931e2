# SPDX-License-Identifier: Apache-2.0
"""Oddities of a frame that breaks no contract, as text that says what to do."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.segmenter.params import SegmenterParams


def range_doubt(depth: DepthImage, view: View, params: SegmenterParams) -> str | None:
    """Text where depth was measured, but none of it, by its ``view``, within the limits of ``params``; else None."""
    if np.isfinite(view.xyz[..., 2]).any():
        return None
    z_min, z_max, _ = params.limits
    measured = depth.depth[np.isfinite(depth.depth) & (depth.depth > 0)]
    if not len(measured) or _within(measured, z_min, z_max):
        return None
    near, middle, far = np.percentile(measured, (0, 50, 100))
    return (
        f"expected depth within z_min … z_max ({z_min:g} … {z_max:g} m), got {len(measured)} pixels of {near:.4g} … "
        f"{far:.4g} m, {middle:.4g} m in the middle; set z_max if that is so; a driver that writes millimetres has to "
        "say 16UC1, since 32FC1 is metres"
    )


def _within(measured: Array, z_min: float, z_max: float) -> bool:
    return bool(((measured > z_min) & (measured < z_max)).any())


def registration_doubt(detections: Detections, depth: DepthImage) -> str | None:
    """Text where boxes and depth have different frames, so are hardly registered; else None."""
    seen, measured = detections.frame_id, depth.frame_id
    if not len(detections) or not seen or not measured or seen == measured:
        return None
    return (
        f"expected depth that is registered to the colour image, of whose frame it then is, got colour in {seen!r} and "
        f"depth in {measured!r}: boxes may cut beside their objects; let the driver register depth, as with "
        "align_depth.enable:=true or the topics depth_registered or aligned_depth_to_color"
    )
