# SPDX-License-Identifier: Apache-2.0
"""What the mapper reports beside what nodes have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from objreg_ros.diagnostics import Diagnostics, family, reading


@dataclass(frozen=True, kw_only=True)
class MapperDiagnostics(Diagnostics):
    """What is known of each robot, and what the last solution believed."""

    odometry: Mapping[str, int] = family("<robot>: odometry", "Poses of odometry that were followed.", "poses")
    passed_over: Mapping[str, int] = family(
        "<robot>: odometry passed over", "Poses that leapt and came back, came again or came late.", "poses"
    )
    placed: Mapping[str, bool] = family(
        "<robot>: placed in the map", "Whether it is known where the odometry of this session is in the map."
    )
    keyframes: Mapping[str, int] = family("<robot>: keyframes", "Keyframes of this session.", "keyframes")
    sessions: int = reading("sessions", "Sessions in the graph, of all robots.", "sessions")
    kept: int = reading("constraints kept", "Constraints that the last solution believed.", "constraints")
    pruned: int = reading("constraints pruned", "Constraints that the last solution did not believe.", "constraints")
    retracted: int = reading("constraints retracted", "Constraints that were withdrawn.", "constraints")
    without_odometry: int = reading(
        "constraints without odometry", "Constraints that wait for odometry of their stamps.", "constraints"
    )
    against_odometry: int = reading(
        "constraints against odometry", "Constraints farther from odometry than its error lets expect.", "constraints"
    )
    farthest: str = reading("farthest from odometry", "The farthest of all constraints.", "m, deg, deviations")
    suspicious: bool = reading(
        "suspicious", "Whether there are [too many of them](troubleshooting.md#constraints-against-odometry)."
    )
