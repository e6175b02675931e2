# SPDX-License-Identifier: Apache-2.0
"""What matched keypoints say of a pose: how many it brings together, and how many more another pose does.

They are counted by the cells of the picture that they lie in, so that the print of one object, which may stand
elsewhere, counts for as little as it covers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, transform
from objreg_ros.registration.candidate import KeypointAgreement
from objreg_ros.registration.kernels.same_pose import AGREEING, near
from objreg_ros.registration.prepare.keypoints import KeypointMatches, Keypoints
from objreg_ros.registration.prepare.prepared import Pair

REPROJECTION_PX = 2.5  # of the view, within which a match agrees with a pose
CELL_RAD = 0.15  # side of a cell: 20 px of a view of 60 degrees
LEAST_KEYPOINTS = 20  # of either view, of fewer nothing is known


def agreements(pair: Pair, poses: Array, others: Array) -> Sequence[KeypointAgreement | None]:
    """What the keypoints say of each of the poses (N, 4, 4); ``others (K, 4, 4)`` may be rivals, as may the poses.

    None for each where a view has hardly any keypoints, for want of grey or of light.
    """
    matches = pair.keypoint_matches
    if min(len(matches.source), len(matches.target)) < LEAST_KEYPOINTS:
        return [None] * len(poses)
    every = np.concatenate([poses, others.reshape(-1, 4, 4)])
    counts = np.array([_count(matches, T) for T in every]).reshape(-1, 2)
    found = []
    for T, own in zip(poses, counts, strict=False):
        apart = ~near(every, T, pair.source.middle, AGREEING)
        found.append(KeypointAgreement(*map(int, (*own, *counts[apart].max(axis=0, initial=0)))))
    return found


def agreeing(matches: KeypointMatches, T_target_source: Array) -> Array:
    """Which matches (M,) bool a pose brings together, by the depth of either end or of both."""
    forth = _errors(matches, T_target_source)
    back = _errors(matches.turned(), inverse(T_target_source))
    return np.asarray(np.fmax(forth, back) < REPROJECTION_PX)


def _count(matches: KeypointMatches, T_target_source: Array) -> tuple[int, int]:
    """How many matches agree with a pose, and in how many cells."""
    agree = agreeing(matches, T_target_source)
    a, b = matches.a[agree], matches.b[agree]
    return len(a), min(_cells(matches.source, a), _cells(matches.target, b))


def _errors(matches: KeypointMatches, T_target_source: Array) -> Array:
    """How far (M,) px of target's picture each point of source is from its match; NaN without depth, inf behind it."""
    source, target, a, b = matches
    x, y, z = transform(T_target_source, source.xyz[a]).T
    ahead = z > 0.0
    seen = np.stack([x, y], axis=1) / np.where(ahead, z, 1.0)[:, None]
    errors = np.linalg.norm(seen - target.rays[b], axis=1) * target.focal_px
    return np.where(source.measured[a], np.where(ahead, errors, np.inf), np.nan)


def _cells(keypoints: Keypoints, chosen: Array) -> int:
    """How many cells the chosen ones lie in."""
    return len(np.unique(np.floor(keypoints.rays[chosen] / CELL_RAD).astype(int), axis=0))
