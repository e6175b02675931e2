# SPDX-License-Identifier: Apache-2.0
"""Pairs of keyframes of a recording with truth: those that could close a loop, and those that could not.

A pair could close when both show an object at one place (one confusable label, middles within `SAME_PLACE` in the
world); it could not when they share a label but no object, and see less than `NO_OVERLAP` of each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED
from objreg_ros.geometry import inverse, rotation_angle, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.labels import LabelGroups
from objreg_ros.registration.prepare.views import DETAIL_SIGMA_PX, Sight, prepare_sight
from objreg_ros.registration.score.free_space import INLIERS
from objreg_ros.registration.score.view_score import count_visibility

BINS = ((0, 10), (10, 20), (20, 30), (30, 45), (45, 180))  # degrees of view change
APART_NS = 2_000_000_000
SAME_PLACE = 0.15  # m
NO_OVERLAP = 0.02


class Pair(NamedTuple):
    """Keyframes by index, the true ``T_target_source``, the view change in degrees, and whether they could close.

    ``lagged`` are the true poses if what was seen is older than its stamp says.
    """

    source: int
    target: int
    T_target_source: Array
    turned: float
    could_close: bool
    lagged: tuple[Array, ...] = ()


class Truths:
    """What is true of the keyframes of a recording; ``lagged`` has the poses again for every lag of what was seen."""

    def __init__(
        self,
        keyframes: Sequence[Keyframe],
        poses: Sequence[Array],
        params: RegistrarParams,
        lagged: Sequence[Sequence[Array]] = (),
    ) -> None:
        self._keyframes, self._poses, self._params, self._lagged = keyframes, poses, params, lagged
        groups = LabelGroups(params.label_groups)
        self._groups = [np.array([groups.of(label) for label in k.labels]) for k in keyframes]
        self._places = [
            transform(T, np.array([o.centroid for o in k.objects]).reshape(-1, 3))
            for k, T in zip(keyframes, poses, strict=True)
        ]
        self._sights: dict[int, Sight] = {}

    def sight(self, index: int) -> Sight:
        """The view of a keyframe, made ready once."""
        if index not in self._sights:
            view, range_m = self._keyframes[index].view, self._params.context_range
            self._sights[index] = prepare_sight(view, range_m, DETAIL_SIGMA_PX)
        return self._sights[index]

    def pair(self, i: int, j: int) -> Pair | None:
        """The pair if it is one or the other kind, None if it is neither or the moments are too near."""
        if abs(self._keyframes[i].stamp_ns - self._keyframes[j].stamp_ns) < APART_NS:
            return None
        named = self._groups[i][:, None] != UNNAMED  # a detector says that these are the same
        same = (self._groups[i][:, None] == self._groups[j][None]) & named
        if not same.any():
            return None
        gaps = np.linalg.norm(self._places[i][:, None] - self._places[j][None], axis=-1)
        T = inverse(self._poses[j]) @ self._poses[i]
        turned = float(np.degrees(rotation_angle(T[:3, :3])))
        lagged = tuple(inverse(poses[j]) @ poses[i] for poses in self._lagged)
        return Pair(i, j, T, turned, bool((gaps[same] < SAME_PLACE).any()), lagged)

    def apart(self, pair: Pair) -> bool:
        """Whether the two views see next to nothing of each other."""
        a, b, T = self.sight(pair.source), self.sight(pair.target), pair.T_target_source
        shares = [
            count_visibility(x, y, M, 2000)[INLIERS] / max(1, min(2000, len(x.points)))
            for x, y, M in ((a, b, T), (b, a, inverse(T)))
        ]
        return max(shares) < NO_OVERLAP


def draw_pairs(truths: Truths, count: int, wanted: int, seed: int) -> list[Pair]:
    """``wanted`` pairs of each kind, those that could close spread over the bins, in a random order."""
    rng = np.random.default_rng(seed)
    indices = rng.permutation(count * count)
    bins: dict[int, list[Pair]] = {k: [] for k in range(len(BINS))}
    apart: list[Pair] = []
    for flat in indices:
        pair = truths.pair(*divmod(int(flat), count))
        if pair is None:
            continue
        if pair.could_close:
            bins[next(k for k, (low, high) in enumerate(BINS) if low <= pair.turned <= high)].append(pair)
        elif len(apart) < wanted and truths.apart(pair):
            apart.append(pair)
    return _spread(list(bins.values()), wanted) + apart


def _spread(bins: list[list[Pair]], wanted: int) -> list[Pair]:
    """Pairs from each bin in turn until there are enough."""
    chosen: list[Pair] = []
    while len(chosen) < wanted and any(bins):
        for pairs in bins:
            if pairs and len(chosen) < wanted:
                chosen.append(pairs.pop())
    return chosen
