# SPDX-License-Identifier: Apache-2.0
"""The whole-view check of a pose: free space both ways, and correlation of the high-passed grey.

Fit error, ICP fitness and object-only scores all accept wrong poses, because a small patch fits in many places. The
whole view does not: what one camera saw to be empty, the other must not fill.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import inverse
from objreg_ros.registrar.candidate import Verification
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.visibility import INLIERS, OCCLUDED, SEEN, VIOLATIONS, Sight, correlation, count, count_many

NO_TEXTURE = 0.2  # what stands in for the texture of a view without grey: less than a right pose usually has
WORST = -3.0  # V where there is nothing to look at
NEUTRAL = 0.65  # what a wrong pose at its best reaches


def verify(
    source: Sight, target: Sight, T_target_source: Array, params: RegistrarParams, sample: int | None = None
) -> Verification:
    """Look at ``T_target_source`` from both views; ``sample`` limits the points that are asked on either side.

    A pose under which the views do not meet comes back with ``tested`` 0 and the lowest score.
    """
    ways = (
        look(source, target, T_target_source, params, sample),
        look(target, source, inverse(T_target_source), params, sample),
    )
    if min(way[SEEN] for way in ways) < 1:
        return Verification(inliers=0.0, violations=1.0, occluded=0.0, texture=None, tested=0, score=WORST)
    asked = sum(min(len(sight.points), sample or len(sight.points)) for sight in (source, target))
    texture, worth = _rated(*ways, source.textured and target.textured, asked)
    return Verification(
        inliers=float(min(way[INLIERS] / way[SEEN] for way in ways)),
        violations=float(max(way[VIOLATIONS] / way[SEEN] for way in ways)),
        occluded=float(max(way[OCCLUDED] / way[SEEN] for way in ways)),
        texture=texture,
        tested=int(ways[0][SEEN] + ways[1][SEEN]),
        score=worth,
    )


def rank(source: Sight, target: Sight, T_target_source: Array, params: RegistrarParams, sample: int) -> Array:
    """V of many poses (K, 4, 4) at once, from the first ``sample`` points a side; -3 where the views do not meet."""
    slops = params.depth_tolerance, params.depth_tolerance_growth
    back = np.array([inverse(T) for T in T_target_source]).reshape(-1, 4, 4)
    forward = count_many(source.points[:sample], source.shades[:sample], T_target_source, *_image(target), *slops)
    backward = count_many(target.points[:sample], target.shades[:sample], back, *_image(source), *slops)
    asked = min(sample, len(source.points)) + min(sample, len(target.points))
    textured = source.textured and target.textured
    return np.array([_rated(a, b, textured, asked)[1] for a, b in zip(forward, backward, strict=True)])


def look(source: Sight, target: Sight, T_target_source: Array, params: RegistrarParams, sample: int | None) -> Array:
    """What the target view says of the source's points; the counts of `visibility.count`."""
    slops = params.depth_tolerance, params.depth_tolerance_growth
    return np.asarray(count(source.points[:sample], source.shades[:sample], T_target_source, *_image(target), *slops))


def _image(sight: Sight) -> tuple[Array, Array, Array, tuple[float, float, float, float]]:
    return sight.near, sight.far, sight.detail, sight.camera


def _rated(forward: Array, backward: Array, textured: bool, asked: int) -> tuple[float | None, float]:
    """(texture, V) of the counts of both ways."""
    if min(forward[SEEN], backward[SEEN]) < 1:
        return None, WORST
    texture = correlation(forward + backward) if textured else None
    inliers = min(forward[INLIERS] / forward[SEEN], backward[INLIERS] / backward[SEEN])
    violations = max(forward[VIOLATIONS] / forward[SEEN], backward[VIOLATIONS] / backward[SEEN])
    return texture, score((inliers, violations), texture, (forward[SEEN] + backward[SEEN]) / asked)


def score(worse: tuple[float, float], texture: float | None, share: float) -> float:
    """V, from the worse way's (inliers, violations), the texture and the share of all points that could be tested.

    Weights rounded from a logistic fit on real frames; a view without grey counts as a weak match.
    """
    inliers, violations = worse
    grey = NO_TEXTURE if texture is None else texture
    return float(grey + inliers - 3.0 * violations + 0.5 * np.log10(max(share, 1e-3)) - NEUTRAL)
