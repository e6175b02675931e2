# SPDX-License-Identifier: Apache-2.0
"""A camera before a table with so many objects on it, at the rate of a Kinect."""

from __future__ import annotations

import numpy as np

from objreg_tools.simulation.scenarios import RecordingPlan
from objreg_tools.simulation.trajectory import Hand, around, carried
from objreg_tools.simulation.world import furniture
from objreg_tools.simulation.world.objects import make_object
from objreg_tools.simulation.world.rooms import TABLE_CLASSES
from objreg_tools.simulation.world.scene import furnished, number, spread

RATE_HZ = 30.0
PASS = 300  # frames to and fro; a longer recording goes so again and again


def table_plan(objects: int, frames: int, seed: int) -> RecordingPlan:
    """A camera that goes to and fro before the table."""
    rng = np.random.default_rng([seed, objects])
    table, room = furniture.table(rng, (1.6, 0.9)), furniture.room(rng, (3.0, 3.0))
    models = [make_object(TABLE_CLASSES[k % len(TABLE_CLASSES)], int(rng.integers(2**31))) for k in range(objects)]
    laid = spread(rng, sorted(models, key=lambda model: -model.radius), table.boards[0], 0.03)
    scene = furnished(rng, [(table, np.eye(4))], room).with_objects(number(laid))
    centre = np.array([0.0, 0.0, table.boards[0][2] + 0.05])
    once = [point for start, stop in ((-40, 40), (40, -40)) for point in around(centre, 1.3, 0.7, start, stop)]
    way = once * max(1, round(frames / PASS))
    poses, rate = carried(way, frames, RATE_HZ, rng, Hand())
    return RecordingPlan((scene,), np.zeros(frames, int), poses, rate)
