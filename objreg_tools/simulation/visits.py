# SPDX-License-Identifier: Apache-2.0
"""How a camera visits a table, and how it is carried from one to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.trajectory import Waypoint, around

Random = np.random.Generator


@dataclass(frozen=True)
class CameraLook:
    """How a table is looked at: from which azimuths in degrees, how far and how high above its top in metres."""

    start: float
    stop: float
    radius: float
    height: float

    @classmethod
    def at_random(cls, rng: Random, start: float, sweep: float) -> CameraLook:
        return cls(start, start + sweep, float(rng.uniform(1.05, 1.3)), float(rng.uniform(0.5, 0.75)))

    def waypoints(self, centre: Array) -> list[Waypoint]:
        return around(centre, self.radius, self.height, self.start, self.stop)


def between(before: Waypoint, after: Waypoint, detour: float) -> list[Waypoint]:
    """From one place to another, ``detour`` to the side; the camera is held level and pans along the walls."""
    out = []
    start, stop = before.target - before.eye, after.target - after.eye
    turned = np.unwrap([np.arctan2(start[1], start[0]), np.arctan2(stop[1], stop[0])])
    for f in (0.2, 0.4, 0.6, 0.8):
        eye = (1 - f) * before.eye + f * after.eye + np.array([0.0, detour * np.sin(np.pi * f), 0.0])
        azimuth = (1 - f) * turned[0] + f * turned[1]
        out.append(Waypoint(eye, eye + np.array([np.cos(azimuth), np.sin(azimuth), -0.2])))
    return out
