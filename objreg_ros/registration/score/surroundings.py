# SPDX-License-Identifier: Apache-2.0
"""What the views say of a pose without the objects that support it.

An object that has moved agrees with itself. Where it fills the views it outvotes everything that stayed, and so do two
that moved together. So one or two that fill much of the views are left out, and what is around them is asked alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.prepare.views import SHADELESS, Band, Print, Sight, pixels_of
from objreg_ros.registration.score.view_score import verify

MUCH = 0.05  # of what a view measured: objects that fill less outvote nothing


def verify_surroundings(
    source: Sight, target: Sight, own: tuple[Array, Array], T_target_source: Array
) -> Verification | None:
    """`verify` without the pixels ``own (h, w) bool`` of either view; None where they are few in both."""
    if max(_share(source, own[0]), _share(target, own[1])) < MUCH:
        return None
    return verify(without(source, own[0]), without(target, own[1]), T_target_source)


def without(sight: Sight, own: Array) -> Sight:
    """A view as if it had measured nothing at the pixels ``own (h, w) bool``, for `verify`: its ``front`` stays."""
    grey, left, printed = sight.grey, ~_shown(own, sight.points, sight), ~_shown(own, sight.grey.points, sight)
    return replace(
        sight,
        near=np.where(own, np.float32(0.0), sight.near),
        far=np.where(own, np.float32(0.0), sight.far),
        points=sight.points[left],
        bands=tuple(Band(band.detail, band.shades[left]) for band in sight.bands),
        grey=Print(np.where(own, np.float32(SHADELESS), grey.detail), grey.points[printed], grey.shades[printed]),
    )


def _shown(own: Array, points: Array, sight: Sight) -> Array:
    """Which points (P, 3) of a view are at the pixels ``own (h, w) bool``; those beyond its image are at the rim."""
    rows, columns = (np.clip(at, 0, size - 1) for at, size in zip(pixels_of(points, sight), own.shape, strict=True))
    return np.asarray(own[rows, columns])


def _share(sight: Sight, own: Array) -> float:
    """How much of what a view measured is at the pixels ``own (h, w) bool``."""
    measured = sight.far > 0
    return float(own[measured].mean()) if measured.any() else 0.0
