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
from objreg_ros.registrar.visibility import INLIERS, OCCLUDED, SEEN, VIOLATIONS, Sight, correlation, count


def verify(
    source: Sight, target: Sight, T_target_source: Array, params: RegistrarParams, sample: int | None = None
) -> Verification:
    """Look at ``T_target_source`` from both views; ``sample`` limits the points that are asked on either side.

    A pose under which the views do not meet comes back with ``tested`` 0 and the lowest score.
    """
    forward = look(source, target, T_target_source, params, sample)
    backward = look(target, source, inverse(T_target_source), params, sample)
    tested = forward[SEEN] + backward[SEEN]
    if min(forward[SEEN], backward[SEEN]) < 1:
        return Verification(inliers=0.0, violations=1.0, occluded=0.0, texture=None, tested=0, score=-3.0)
    worse = [
        max(way[VIOLATIONS] / way[SEEN] for way in (forward, backward)),
        max(way[OCCLUDED] / way[SEEN] for way in (forward, backward)),
        min(way[INLIERS] / way[SEEN] for way in (forward, backward)),
    ]
    texture = correlation(forward + backward) if source.textured and target.textured else None
    return Verification(
        inliers=float(worse[2]),
        violations=float(worse[0]),
        occluded=float(worse[1]),
        texture=texture,
        tested=int(tested),
        score=score(
            forward,
            backward,
            texture,
            min(len(source.points), sample or 1 << 30) + min(len(target.points), sample or 1 << 30),
        ),
    )


def look(source: Sight, target: Sight, T_target_source: Array, params: RegistrarParams, sample: int | None) -> Array:
    """What the target view says of the source's points; the counts of `visibility.count`."""
    tolerance, growth = params.depth_tolerance, params.depth_tolerance_growth
    points, shades = source.points[:sample], source.shades[:sample]
    return np.asarray(
        count(points, shades, T_target_source, target.near, target.far, target.detail, target.camera, tolerance, growth)
    )


def score(forward: Array, backward: Array, texture: float | None, asked: int) -> float:
    """V: texture plus overlap, less what floats in free space and what is hidden."""
    both = forward + backward
    seen = both[SEEN]
    overlap = both[INLIERS] / max(1, asked)
    evidence = 0.3 * overlap - 2.0 * both[VIOLATIONS] / seen - 0.3 * both[OCCLUDED] / seen
    return float(evidence + (texture if texture is not None else 0.0))
