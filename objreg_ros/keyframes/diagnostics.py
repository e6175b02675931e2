# SPDX-License-Identifier: Apache-2.0
"""What the keyframer reports beside what nodes have in common."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.diagnostics import Diagnostics, reading


@dataclass(frozen=True, kw_only=True)
class KeyframerDiagnostics(Diagnostics):
    """What was sent."""

    sent: int = reading("keyframes sent", "Keyframes that were published.", "keyframes")
    mean_kilobytes: float | None = reading(
        "kilobytes a keyframe", "Their mean size; absent before the first.", "kB", "{:.1f}", default=None
    )
    without_odometry: int = reading(
        "frames without odometry", "Frames that came, or are used, without odometry.", "frames"
    )
