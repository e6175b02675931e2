# SPDX-License-Identifier: Apache-2.0
"""Which known objects a view should show, and whether it does.

An object is seen where one of its label group is within reach of its place. It is missing only where the view looks
through its place: depth behind it all over its middle, widened by how uncertain the place is. What is hidden, cut off
by the picture, or not measured says nothing. So an object before a wall that it has left is missing, and a cup
on a table that a hand has moved mostly says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.sensor import DEPTH_TOLERANCE_GROWTH, DEPTH_TOLERANCE_M

DEVIATIONS = 2.0  # of its place, by which an object may be off
MOST_SIGMA_M = 0.3  # of a place that is less certain nothing is expected
RANGE_M = 0.4, 4.0  # of depth
REACH_M, WANDERS = 0.1, 0.2  # between two sightings of an object: a length, and a share of its extent
CORE = 0.25  # of the extent: the radius of the middle that must be looked through
LEAST_PIXELS = 9  # of that middle with known depth
LEAST_KNOWN = 0.5  # of its pixels
LEAST_BEHIND = 0.9  # of those with known depth


class Look(Enum):
    """What a view shows in the place of a known object; OUTSIDE where it is not in the picture, or too vague."""

    SEEN = "seen"
    MISSING = "missing"
    NOTHING = "nothing"
    OUTSIDE = "outside"


class Place(NamedTuple):
    """Where an object should be: its middle ``xyz (3,)`` m in the camera, each axis to ``sigma_m``."""

    landmark: int
    group: str
    xyz: Array
    extent: float
    sigma_m: float


class Shown(NamedTuple):
    """An object that a keyframe shows: its label group and its middle ``xyz (3,)`` m in the camera."""

    group: str
    xyz: Array


def looks_of(places: Sequence[Place], shown: Sequence[Shown], view: View) -> list[Look]:
    """What a view shows in each place."""
    inside = _inside(places, view)
    return [_look(place, shown, view) if yes else Look.OUTSIDE for place, yes in zip(places, inside, strict=True)]


def _inside(places: Sequence[Place], view: View) -> list[bool]:
    """Whether the middle of each place is in the picture and near enough to be measured."""
    if not places:
        return []
    k = view.intrinsics
    x, y, z = np.array([place.xyz for place in places]).T
    ahead = (z > RANGE_M[0]) & (z < RANGE_M[1])
    depth = np.where(ahead, z, 1.0)
    u, v = k.fx * x / depth + k.cx, k.fy * y / depth + k.cy
    vague = np.array([place.sigma_m for place in places]) > MOST_SIGMA_M
    found = ahead & (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height) & ~vague
    return [bool(yes) for yes in found]


def _look(place: Place, shown: Sequence[Shown], view: View) -> Look:
    reach = REACH_M + WANDERS * place.extent + DEVIATIONS * place.sigma_m
    if any(one.group == place.group and float(np.linalg.norm(one.xyz - place.xyz)) < reach for one in shown):
        return Look.SEEN
    return Look.MISSING if _is_looked_through(place, view) else Look.NOTHING


def _is_looked_through(place: Place, view: View) -> bool:
    """Whether nothing is in a place nor before it, as far as it is known where that is."""
    k, (x, y, z) = view.intrinsics, place.xyz.tolist()
    slack = DEVIATIONS * place.sigma_m
    radius = CORE * place.extent + slack
    left, right = (round(k.fx * (x + side * radius) / z + k.cx) for side in (-1, 1))
    top, bottom = (round(k.fy * (y + side * radius) / z + k.cy) for side in (-1, 1))
    if left < 0 or top < 0 or right >= k.width or bottom >= k.height:
        return False
    depth = view.xyz[top : bottom + 1, left : right + 1, 2]
    known = depth[np.isfinite(depth)]
    if len(known) < max(LEAST_PIXELS, LEAST_KNOWN * depth.size):
        return False
    behind = z + 0.5 * place.extent + slack + DEPTH_TOLERANCE_M + DEPTH_TOLERANCE_GROWTH * z * z
    return bool(np.mean(known > behind) >= LEAST_BEHIND)
