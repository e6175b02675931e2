# SPDX-License-Identifier: Apache-2.0
"""Plans of the recordings of several robots at once: one world, one clock, and each robot's own path.

| scenario | what happens |
| --- | --- |
| `robots` | three robots in three rooms (`building`); each pair of them visits the table of at least one room |

Each looks at a table from a little aside of where the others do. A robot begins when the one before has a third of its
path behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from objreg_tools.simulation.scenarios import RecordingPlan
from objreg_tools.simulation.trajectory import Hand, Waypoint, carried
from objreg_tools.simulation.visits import CameraLook
from objreg_tools.simulation.world.building import OPENINGS_X, ROOMS_X, Building, make_building
from objreg_tools.simulation.world.scene import Scene

Random = np.random.Generator
Ways = tuple[Scene, list[list[Waypoint]]]
"""The scene, and the path of each robot."""

ROUTES = ((0, 1, 0, 1), (2, 1, 2, 1), (0, 1, 2, 1))
"""The tables that each robot visits, by the numbers of their rooms."""
ROBOTS = len(ROUTES)
ASIDES = (0.0, 1.0, -1.0)
"""To which side of the front of a table each robot stands."""
HEIGHT_M = 1.35
"""The height at which a camera is carried from room to room."""
STEP_M = 0.7
"""So far before and behind an opening a robot looks straight through it."""
BEHIND = 1 / 3
"""Each robot has this share of its path behind it when the next one begins."""


def _robots(rng: Random, occluders: int) -> Ways:
    building = make_building(rng, occluders)
    return building.scene, [_way(rng, building, *of) for of in zip(ROUTES, ASIDES, strict=True)]


def _way(rng: Random, building: Building, route: Sequence[int], aside: float) -> list[Waypoint]:
    """Past the tables of a route in turn, each time from a little aside of the last."""
    off = aside * float(rng.uniform(15, 35))
    way: list[Waypoint] = []
    for k, room in enumerate(route):
        if k > 0:
            way += _through(route[k - 1], room)
        sweep = float(rng.choice([-1, 1])) * 40
        start = building.fronts[room] + off + float(rng.uniform(-10, 10)) - sweep / 2
        way += CameraLook.at_random(rng, start, sweep).waypoints(building.scene.places[room].centre)
    return way


def _through(before: int, after: int) -> list[Waypoint]:
    """From a room to one beside it, looking ahead."""
    ahead = float(np.sign(ROOMS_X[after] - ROOMS_X[before]))
    at = OPENINGS_X[min(before, after)]
    eyes = [np.array([at + ahead * step, 0.0, HEIGHT_M]) for step in (-STEP_M, 0.0, STEP_M)]
    return [Waypoint(eye, eye + np.array([ahead, 0.0, -0.2])) for eye in eyes]


FLEETS: dict[str, Callable[[Random, int], Ways]] = {"robots": _robots}


def make_fleet(
    scenario: str, seed: int, frames: int = 600, rate: float = 30.0, occluders: int = 0
) -> list[RecordingPlan]:
    """A plan for each robot, ``frames`` long; everything follows from the arguments.

    All have one scene and one ``rate`` in Hz, which comes down where so few frames would make the longest path faster
    than a hand moves a camera. The robots are called robot1, robot2 and so on. ValueError for an unknown scenario.
    """
    if scenario not in FLEETS:
        raise ValueError(f"expected one of {', '.join(FLEETS)}, got {scenario!r}")
    rng = np.random.default_rng([seed, 32, list(FLEETS).index(scenario)])
    scene, ways = FLEETS[scenario](rng, occluders)
    rate = float(min(carried(way, frames, rate, rng, Hand())[1] for way in ways))
    later_ns = round(BEHIND * 1e9 * frames / rate)
    poses = [carried(way, frames, rate, rng, Hand())[0] for way in ways]
    first = np.zeros(frames, int)
    return [RecordingPlan((scene,), first, T, rate, f"robot{k + 1}", k * later_ns) for k, T in enumerate(poses)]
