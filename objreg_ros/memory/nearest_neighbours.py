# SPDX-License-Identifier: Apache-2.0
"""The stored objects of one label group, and the scan that finds the nearest of them.

A scan is exact. Descriptors lie by dimension in tiles of `LANES` objects, so that the processor compares many at once.
They are compared twice: rounded to bytes, a quarter of what a scan would have to read, and as they are. The bytes bound
how similar an object of a tile can be. The descriptors themselves, and the other columns of an object, are
looked at only in tiles that may hold one of the nearest.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection
from typing import NamedTuple

import numba
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.descriptor import EMPHASIS, SIZE
from objreg_ros.memory.params import MemoryParams
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registration.kernels.projection import FAST

LANES = 64
NOWHERE = np.float32(np.inf)  # half the squared length of a row that is free
STEP = np.repeat(np.array([1 / 32, 1 / 64], np.float32), [3, SIZE - 3])  # of the bytes: sizes lie in ±4, shares in ±2
ROUNDING = 1e-5  # relative: what single precision may lose in a comparison, with a margin
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
        found, similarity = _closest(  # type: ignore[call-arg]
            self._descriptors[:tiles], self._bytes[:tiles], self._half_norms[:tiles], self._spans, self.where,
            self.when, descriptor, np.asarray(sighting.position, float), sighting.travelled, sighting.stamp_ns, session,
            round(1e9 * params.min_gap), params.odometry_radius, params.odometry_drift, sessions.own, sessions.hidden,
            most, margin,
        )  # fmt: skip
        return found, np.maximum(0.5 * float(descriptor @ descriptor) - similarity, 0.0)

    def _grow(self) -> None:
        self.where = np.concatenate([self.where, np.zeros_like(self.where)])
        self.when = np.concatenate([self.when, np.zeros_like(self.when)])
        self._descriptors = np.concatenate([self._descriptors, np.zeros_like(self._descriptors)])
        self._bytes = np.concatenate([self._bytes, np.zeros_like(self._bytes)])
        self._half_norms = np.concatenate([self._half_norms, np.full_like(self._half_norms, NOWHERE)])
        self._spans = np.concatenate([self._spans, np.zeros_like(self._spans)])


@numba.njit(cache=True, nogil=True)
def _closest(  # type: ignore[no-untyped-def]
    descriptors, steps, half_norms, spans, where, when, descriptor, position, way, stamp_ns, session, gap_ns, radius,
    drift, own, hidden, most, margin,
):  # fmt: skip
    """The rows, the nearest first, and their similarity: half the squared distance below half a length.

    The tiles that promise most come first. What they hold is mostly so alike that few others need be seen.
    """
    tops = _promised(steps, half_norms, spans, descriptor)
    floor = np.partition(tops, len(tops) - most)[len(tops) - most] if len(tops) > most else -NOWHERE
    seen = (descriptors, half_norms, tops, where, when, descriptor, position, way, stamp_ns, session, gap_ns, radius,
            drift, own, hidden, margin)  # fmt: skip
    best = [(-NOWHERE, 0, 0) for _ in range(most)]  # as a heap: the least is the first
    closest = _look(best, -NOWHERE, floor, NOWHERE, *seen)
    _look(best, closest, -NOWHERE, floor, *seen)
    best.sort(reverse=True)
    near = 0
    while near < most and best[near][0] > max(best[0][0] - margin, -NOWHERE):
        near += 1
    return np.array([row for _, _, row in best[:near]], np.int64), np.array([score for score, _, _ in best[:near]])


@numba.njit(cache=True, nogil=True)
def _promised(steps, half_norms, spans, descriptor):  # type: ignore[no-untyped-def]
    """The most that an object of each tile can be similar, by the bytes."""
    tops, out = np.empty(len(half_norms), np.float32), np.empty(LANES, np.float32)
    length, scaled = np.sqrt(np.sum(descriptor * descriptor)), descriptor * STEP
    for tile in range(len(tops)):
        off, reach = spans[tile]
        unsure = length * off + ROUNDING * reach * (reach + length)
        tops[tile] = _compare_bytes(steps[tile], half_norms[tile], scaled, out) + unsure
    return tops


@numba.njit(cache=True, nogil=True)
def _look(  # type: ignore[no-untyped-def]
    best, closest, low, high, descriptors, half_norms, tops, where, when, descriptor, position, way, stamp_ns, session,
    gap_ns, radius, drift, own, hidden, margin,
):  # fmt: skip
    """Put the most similar of the tiles that promise from ``low`` to below ``high`` on the heap ``best``.

    An item is similarity, how old, row; none is -inf. The highest similarity so far goes in and comes back.
    """
    similarity = np.empty(LANES, np.float32)
    for tile in range(len(tops)):
        least = max(best[0][0], closest - margin, low)
        if tops[tile] < least or tops[tile] >= high or tops[tile] == -NOWHERE:
            continue
        least = max(best[0][0], closest - margin)
        if _compare(descriptors[tile], half_norms[tile], descriptor, similarity) < least:
            continue
        for lane in range(LANES):
            row, score = tile * LANES + lane, similarity[lane]
            if score < least or score == -NOWHERE or _holds(hidden, when[row, 1]):
                continue
            if abs(when[row, 0] - stamp_ns) < gap_ns and _holds(own, when[row, 1]):
                continue
            if when[row, 1] == session and when[row, 3]:
                reach = radius + drift * abs(way - where[row, 3])
                x, y, z = where[row, 0] - position[0], where[row, 1] - position[1], where[row, 2] - position[2]
                if x * x + y * y + z * z > reach * reach:
                    continue
            heapq.heappushpop(best, (score, -when[row, 2], row))
            closest = max(closest, score)
    return closest


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


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _compare_bytes(steps, half_norms, descriptor, out):  # type: ignore[no-untyped-def]
    """The same by the bytes, three dimensions at once: a third less time. `SIZE` is a multiple of three."""
    for lane in range(LANES):
        out[lane] = -half_norms[lane]
    for k in range(0, SIZE, 3):
        a, b, c = descriptor[k], descriptor[k + 1], descriptor[k + 2]
        for lane in range(LANES):
            out[lane] += a * steps[k, lane] + b * steps[k + 1, lane] + c * steps[k + 2, lane]
    largest = out[0]
    for lane in range(LANES):
        largest = max(largest, out[lane])
    return largest
