# SPDX-License-Identifier: Apache-2.0
"""The stored objects of one label group, and the scan that finds the nearest of them.

A scan is exact: it compares every descriptor of the group, and looks at the other columns of an object only where it is
among the nearest so far. Descriptors lie by dimension in tiles of `LANES` objects, so that the processor compares many
at once: 1e5 of them take about a third of a millisecond.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection
from typing import NamedTuple

import numba
import numpy as np

from objreg_ros.data import Array
from objreg_ros.memory.descriptor import EMPHASIS, SIZE
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registration.kernels.projection import FAST
from objreg_ros.registration.params import RegistrarParams

LANES = 64
NOWHERE = np.float32(np.inf)  # half the squared length of a row that is free
NO_SESSION = -1  # of what our own tracking says where it is: nothing is left out for it


class Sessions(NamedTuple):
    """Those of the robot that asks, and those that are left out: (S,) int64 each, sorted."""

    own: Array
    hidden: Array

    @classmethod
    def of(cls, own: Collection[int], hidden: Collection[int]) -> Sessions:
        """Of the numbers of sessions."""
        return cls(*(np.array(sorted(numbers), np.int64) for numbers in (own, hidden)))


NO_SESSIONS = Sessions.of((), ())


class Block:
    """The rows of one label group, which double when they are full; rows that are given up are used again.

    ``where (n, 4)`` float64 are x, y, z and travelled, ``when (n, 4)`` int64 stamp_ns, session, keyframe_id and whether
    odometry told the pose.
    """

    def __init__(self) -> None:
        self.where, self.when = np.zeros((LANES, 4)), np.zeros((LANES, 4), np.int64)
        self._descriptors = np.zeros((1, SIZE, LANES), np.float32)
        self._half_norms = np.full((1, LANES), NOWHERE)
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
        self.where[i] = *sighting.position, sighting.travelled
        self.when[i] = sighting.stamp_ns, sighting.session, sighting.keyframe_id, sighting.by_odometry
        return i

    def remove(self, i: int) -> None:
        """Give up a row."""
        self._half_norms[i // LANES, i % LANES] = NOWHERE
        self._free.append(i)

    def nearest(
        self, sighting: Sighting, params: RegistrarParams, most: int, margin: float, sessions: Sessions = NO_SESSIONS
    ) -> tuple[Array, Array]:
        """The rows (at most ``most``) that look most like this one, and half their squared distances, (K,) each.

        Left out are those farther away in half the squared distance than the nearest by ``margin``, those of hidden
        ``sessions``, those of the robot's own and of this one that are nearer in time than the least gap, and where
        odometry says that they cannot be here. Among equals the older keyframe comes first.
        """
        tiles = -(-self._used // LANES)
        descriptor = EMPHASIS * np.asarray(sighting.descriptor, np.float32)
        session = sighting.session if sighting.by_odometry else NO_SESSION
        found, similarity = _likest(  # type: ignore[call-arg]
            self._descriptors[:tiles], self._half_norms[:tiles], self.where, self.when, descriptor,
            np.asarray(sighting.position, float), sighting.travelled, sighting.stamp_ns, session,
            round(1e9 * params.min_gap), params.odometry_radius, params.odometry_drift, sessions.own, sessions.hidden,
            most, margin,
        )  # fmt: skip
        return found, np.maximum(0.5 * float(descriptor @ descriptor) - similarity, 0.0)

    def _grow(self) -> None:
        self.where = np.concatenate([self.where, np.zeros_like(self.where)])
        self.when = np.concatenate([self.when, np.zeros_like(self.when)])
        self._descriptors = np.concatenate([self._descriptors, np.zeros_like(self._descriptors)])
        self._half_norms = np.concatenate([self._half_norms, np.full_like(self._half_norms, NOWHERE)])


@numba.njit(cache=True, nogil=True)
def _likest(  # type: ignore[no-untyped-def]
    descriptors, half_norms, where, when, descriptor, position, way, stamp_ns, session, gap_ns, radius, drift, own,
    hidden, most, margin,
):  # fmt: skip
    """The rows, the nearest first, and their similarity: half the squared distance below half a length.

    So many tiles have an object that is at least as similar as the floor: where odometry lets them, no other need be
    seen.
    """
    likeness, tops = np.empty(half_norms.shape, np.float32), np.empty(len(half_norms), np.float32)
    for tile in range(len(tops)):
        tops[tile] = _compare(descriptors[tile], half_norms[tile], descriptor, likeness[tile])
    floor = np.partition(tops, len(tops) - most)[len(tops) - most] if len(tops) > most else -NOWHERE
    seen = (likeness, tops, where, when, position, way, stamp_ns, session, gap_ns, radius, drift, own, hidden, margin)
    best = _best(most, floor, *seen)
    if best[-1][0] == -NOWHERE and floor > -NOWHERE:
        best = _best(most, -NOWHERE, *seen)
    near = 0
    while near < most and best[near][0] > max(best[0][0] - margin, -NOWHERE):
        near += 1
    return np.array([row for _, _, row in best[:near]], np.int64), np.array([like for like, _, _ in best[:near]])


@numba.njit(cache=True, nogil=True)
def _best(  # type: ignore[no-untyped-def]
    most,
    floor,
    likeness,
    tops,
    where,
    when,
    position,
    way,
    stamp_ns,
    session,
    gap_ns,
    radius,
    drift,
    own,
    hidden,
    margin,
):
    """The best that are at least as similar as the floor, in falling order: similarity, how old, row; none is -inf."""
    best = [(-NOWHERE, 0, 0) for _ in range(most)]  # as a heap: the least is the first
    likest = -NOWHERE
    for tile in range(len(tops)):
        least = max(best[0][0], likest - margin, floor)
        if tops[tile] < least or tops[tile] == -NOWHERE:
            continue
        for lane in range(LANES):
            row, like = tile * LANES + lane, likeness[tile, lane]
            if like < least or like == -NOWHERE or _holds(hidden, when[row, 1]):
                continue
            if abs(when[row, 0] - stamp_ns) < gap_ns and _holds(own, when[row, 1]):
                continue
            if when[row, 1] == session and when[row, 3]:
                reach = radius + drift * abs(way - where[row, 3])
                x, y, z = where[row, 0] - position[0], where[row, 1] - position[1], where[row, 2] - position[2]
                if x * x + y * y + z * z > reach * reach:
                    continue
            heapq.heappushpop(best, (like, -when[row, 2], row))
            likest = max(likest, like)
    best.sort(reverse=True)
    return best


@numba.njit(cache=True, nogil=True)
def _holds(numbers, number):  # type: ignore[no-untyped-def]
    """Whether a number is among sorted ones."""
    k = np.searchsorted(numbers, number)
    return k < len(numbers) and numbers[k] == number


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _compare(descriptors, half_norms, descriptor, out):  # type: ignore[no-untyped-def]
    """The similarity of every object of a tile, into ``out``; the largest comes back."""
    for lane in range(LANES):
        out[lane] = -half_norms[lane]
    for k in range(len(descriptor)):
        for lane in range(LANES):
            out[lane] += descriptor[k] * descriptors[k, lane]
    largest = out[0]
    for lane in range(LANES):
        largest = max(largest, out[lane])
    return largest
