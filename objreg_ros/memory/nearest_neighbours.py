# SPDX-License-Identifier: Apache-2.0
"""The stored objects of one label group, and the scan that finds the nearest of them.

A scan is exact. Descriptors lie by dimension in tiles of `LANES` objects, so that the processor compares many at once.
They are compared twice: rounded to bytes, a quarter of what a scan would have to read, and as they are. The bytes bound
how similar an object of a tile can be. The descriptors themselves, and the other columns of an object, are
looked at only in tiles that may hold one of the nearest.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.descriptor import EMPHASIS, SIZE
from objreg_ros.memory.params import MemoryParams
from objreg_ros.memory.sighting import Sighting
from objreg_ros.native import kernels

_KERNELS = kernels("nearest_neighbours")
LANES = 64  # of the kernels
NOWHERE = np.float32(np.inf)  # half the squared length of a row that is free
STEP = np.repeat(np.array([1 / 32, 1 / 64], np.float32), [3, SIZE - 3])  # of the bytes: sizes lie in ±4, shares in ±2
NO_SESSION = -1  # of what our own tracking says where it is: nothing is left out for it


class SessionFilter(NamedTuple):
    """Those of the robot that asks, and those that are left out: (S,) int64 each, sorted."""

    own: Array
    hidden: Array

    @classmethod
    def of(cls, own: Collection[int], hidden: Collection[int]) -> SessionFilter:
        """Of the numbers of sessions."""
        return cls(*(np.array(sorted(numbers), np.int64) for numbers in (own, hidden)))


NO_SESSIONS = SessionFilter.of((), ())


class Block:
    """The rows of one label group, which double when they are full; rows that are given up are used again.

    ``where (n, 4)`` float64 are x, y, z and travelled, ``when (n, 4)`` int64 stamp_ns, session, keyframe_id and whether
    odometry gave the pose.
    """

    def __init__(self) -> None:
        self.where, self.when = np.zeros((LANES, 4)), np.zeros((LANES, 4), np.int64)
        self._descriptors = np.zeros((1, SIZE, LANES), np.float32)
        self._bytes = np.zeros((1, SIZE, LANES), np.int8)  # the descriptors in steps of `STEP`
        self._half_norms = np.full((1, LANES), NOWHERE)
        self._spans = np.zeros((1, 2), np.float32)  # of a tile: the most that the bytes are off, the greatest length
        self._used = 0  # rows below which all others are
        self._free: list[int] = []

    def __len__(self) -> int:
        return self._used - len(self._free)

    def append(self, sighting: Sighting) -> int:
        """Take in an object; the row that it has from now on."""
        if self._used == len(self.when):
            self._grow()
        i = self._free.pop() if self._free else self._used
        self._used = max(self._used, i + 1)
        tile, lane = divmod(i, LANES)
        descriptor = EMPHASIS * sighting.descriptor
        self._descriptors[tile, :, lane] = descriptor
        self._half_norms[tile, lane] = 0.5 * float(descriptor @ descriptor)
        rounded = np.rint(descriptor / STEP).clip(-128, 127)
        self._bytes[tile, :, lane] = rounded
        span = np.linalg.norm(descriptor - STEP * rounded), np.linalg.norm(descriptor)
        self._spans[tile] = np.maximum(self._spans[tile], span)
        self.where[i] = *sighting.position, sighting.travelled
        self.when[i] = sighting.stamp_ns, sighting.session, sighting.keyframe_id, sighting.by_odometry
        return i

    def remove(self, i: int) -> None:
        """Give up a row."""
        self._half_norms[i // LANES, i % LANES] = NOWHERE
        self._free.append(i)

    def nearest(
        self, sighting: Sighting, params: MemoryParams, most: int, margin: float, sessions: SessionFilter = NO_SESSIONS
    ) -> tuple[Array, Array]:
        """The rows (at most ``most``) that look most like this one, and half their squared distances, (K,) each.

        Left out are those farther away in half the squared distance than the nearest by ``margin``, those of hidden
        ``sessions``, those of the robot's own and of this one that are nearer in time than the least gap, and where
        odometry says that they cannot be here. Among equals the older keyframe comes first.
        """
        tiles = -(-self._used // LANES)
        descriptor = EMPHASIS * np.asarray(sighting.descriptor, np.float32)
        session = sighting.session if sighting.by_odometry else NO_SESSION
        found, similarity = _KERNELS.closest(
            self._descriptors[:tiles], self._bytes[:tiles], self._half_norms[:tiles], self._spans, self.where,
            self.when, descriptor, STEP, np.asarray(sighting.position, float), sighting.travelled, sighting.stamp_ns,
            session, round(1e9 * params.min_gap), params.odometry_radius, params.odometry_drift, sessions.own,
            sessions.hidden, most, margin,
        )  # fmt: skip
        return found, np.maximum(0.5 * float(descriptor @ descriptor) - similarity, 0.0)

    def _grow(self) -> None:
        self.where, self.when = _doubled(self.where), _doubled(self.when)
        self._descriptors, self._bytes = _doubled(self._descriptors), _doubled(self._bytes)
        self._spans = _doubled(self._spans)
        self._half_norms = np.concatenate([self._half_norms, np.full_like(self._half_norms, NOWHERE)])


def _doubled(rows: Array) -> Array:
    """The rows with as many zeros after them, which take no memory until they are written."""
    doubled = np.zeros((2 * len(rows), *rows.shape[1:]), rows.dtype)
    doubled[: len(rows)] = rows
    return doubled
