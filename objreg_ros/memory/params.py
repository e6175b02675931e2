# SPDX-License-Identifier: Apache-2.0
"""The parameters of the store, and of the choice among what it holds."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import param
from objreg_ros.registration.params import RegistrationParams


@dataclass(frozen=True)
class MemoryParams(RegistrationParams):
    """What is stored, and which stored keyframes a new one is compared with."""

    store: str = param("", "the SQLite file that remembers; empty: a temporary one, gone at the end", at_start=True)
    max_views: int = param(8, "views of one object that are kept, the most diverse", ge=1)
    max_keyframes: int = param(20000, "most keyframes that are kept; the oldest go first", ge=1)
    max_megabytes: float = param(10000.0, "largest store; the oldest keyframes go first", "MB", ge=1.0)

    # Which stored keyframes a new one is compared with.
    min_gap: float = param(2.0, "least time between the two keyframes of a constraint", "s", ge=0.0, live=True)
    odometry_radius: float = param(
        1.0, "stored objects of the session that odometry puts farther away are not tried", "m", ge=0.0, live=True
    )
    thin_seconds: float = param(1.0, "two closures are one if both their ends are nearer than this", "s", ge=0.0)
    candidates: int = param(4, "stored keyframes that are tried for each new one, best first", ge=1, le=100, live=True)
