# SPDX-License-Identifier: Apache-2.0
"""What the segmenter reports beside what nodes have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from objreg_ros.diagnostics import Diagnostics, family, reading


@dataclass(frozen=True, kw_only=True)
class SegmenterDiagnostics(Diagnostics):
    """Where gravity came from, and how the sensor errs."""

    gravity_from: Mapping[str, int] = family(
        "gravity from <source>", "Frames whose gravity is of a source: `imu`, `picture`, `odom` or `nothing`.", "frames"
    )
    median_apart_deg: float | None = reading(
        "gravity of imu and picture apart p50 [deg]",
        "The median angle between the two, of the last hundred frames that have both.",
        "deg",
        "{:.1f}",
        default=None,
    )
    imu: Mapping[str, int] = family(
        "imu <reason>",
        "What of the IMU was not used: `late`, `time_jump`, `gap` (the filter began anew), `no_acceleration`, `norm`, "
        "`turn` (nothing that gives a direction), `orientation_disagrees`, `unknown_frame`.",
    )
    noise: float | None = reading(
        "depth noise (a Kinect v1 has 1)",
        "The noise of depth in that of a Kinect v1, the median of the last frames that show it.",
        form="{:.2f}",
        default=None,
    )
    turned: str | None = reading(
        "depth is turned against colour by",
        "The rotation that is undone in every frame: about x, y and z, and its spread from frame to frame.",
        "deg",
        default=None,
    )
    lag: str | None = reading(
        "depth is behind colour by",
        "How late depth is behind colour, with its deviation; only where it is known within 10 ms.",
        "ms",
        default=None,
    )
