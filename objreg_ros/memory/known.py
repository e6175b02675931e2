# SPDX-License-Identifier: Apache-2.0
"""What is remembered of one landmark: numbers side by side, not objects, since a store may hold a million."""

from __future__ import annotations

import sys
from array import array
from collections import Counter
from collections.abc import Iterator, MutableMapping
from dataclasses import dataclass, field

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.sighting import Sighting


class Viewpoints(MutableMapping[int, Array]):
    """Keyframe id → (3,) m from the object to the camera, in the landmark's axes; in the order that they came in.

    Some dozens at most: a look-up goes through all of them.
    """

    __slots__ = ("_keyframes", "_xyz")

    def __init__(self) -> None:
        self._keyframes, self._xyz = array("q"), array("d")

    def __len__(self) -> int:
        return len(self._keyframes)

    def __iter__(self) -> Iterator[int]:
        return iter(self._keyframes)

    def __contains__(self, keyframe_id: object) -> bool:
        return keyframe_id in self._keyframes

    def __getitem__(self, keyframe_id: int) -> Array:
        start = 3 * self._index(keyframe_id)
        return np.array(self._xyz[start : start + 3])

    def __setitem__(self, keyframe_id: int, viewpoint: Array) -> None:
        if keyframe_id in self._keyframes:
            start = 3 * self._index(keyframe_id)
            self._xyz[start : start + 3] = array("d", viewpoint.tolist())
            return
        self._keyframes.append(keyframe_id)
        self._xyz.extend(viewpoint.tolist())

    def __delitem__(self, keyframe_id: int) -> None:
        i = self._index(keyframe_id)
        del self._keyframes[i], self._xyz[3 * i : 3 * i + 3]

    def _index(self, keyframe_id: int) -> int:
        try:
            return self._keyframes.index(keyframe_id)
        except ValueError:
            raise KeyError(keyframe_id) from None


@dataclass(slots=True, eq=False)
class Last:
    """The latest sighting, without what only retrieval needs. ``numbers (14,)`` are what the properties return."""

    session: int
    stamp_ns: int
    label: str
    robot: str
    numbers: Array

    @property
    def position(self) -> Array:
        """(3,) m in the frame of the session."""
        return self.numbers[:3]

    @property
    def R_landmark_session(self) -> Array:
        """(3, 3), a copy: see `Sighting`."""
        return self.numbers[3:12].reshape(3, 3).copy()

    @property
    def extent(self) -> float:
        """Of the object, m."""
        return float(self.numbers[12])

    @property
    def travelled(self) -> float:
        """Of the camera in the session until then, m."""
        return float(self.numbers[13])


@dataclass(slots=True, eq=False)
class Known:
    """One landmark: its latest sighting, votes for its label, and from where each keyframe saw it."""

    last: Last
    votes: Counter[str] = field(default_factory=Counter)
    views: Viewpoints = field(default_factory=Viewpoints)

    def spare(self, limit: int) -> set[int]:
        """The keyframes that are left when ``limit`` of the most diverse viewpoints are taken one after the other."""
        if len(self.views) <= limit:
            return set()
        keys = sorted(self.views)
        points = np.array([self.views[k] for k in keys])
        directions = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-9)
        chosen = [len(keys) - 1]  # the newest stays: it shows the place as it is
        distance = np.full(len(keys), np.inf)
        while len(chosen) < limit:
            last = chosen[-1]
            step = np.linalg.norm(directions - directions[last], axis=1)
            step += 0.5 * np.abs(np.linalg.norm(points, axis=1) - np.linalg.norm(points[last]))
            distance = np.minimum(distance, step)
            distance[chosen] = -1.0
            chosen.append(int(distance.argmax()))
        return set(keys) - {keys[i] for i in chosen}


def last_of(sighting: Sighting) -> Last:
    """What is kept of a sighting as the latest of its landmark."""
    numbers = (*sighting.position, *sighting.R_landmark_session.ravel(), sighting.extent, sighting.travelled)
    label, robot = sys.intern(sighting.label), sys.intern(sighting.robot)
    return Last(sighting.session, sighting.stamp_ns, label, robot, np.array(numbers, float))
