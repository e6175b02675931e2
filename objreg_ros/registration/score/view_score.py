# SPDX-License-Identifier: Apache-2.0
"""The whole-view check of a pose: free space both ways, and correlation of the high-passed grey.

Fit error, ICP fitness and object-only scores all accept wrong poses, because a small patch fits in many places. The
whole view does not: what one camera saw to be empty, the other must not fill.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, inverses
from objreg_ros.native import kernels
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.prepare.views import Sight
from objreg_ros.registration.score.free_space import INLIERS, OCCLUDED, SEEN, VIOLATIONS, correlation, count, count_many
from objreg_ros.registration.score.photometric import NARROW, compare, correlate_views
from objreg_ros.sensor import depth_tolerance

_KERNELS = kernels("view_score")
RANKING_POINTS = 500  # a side, of the views, by which hypotheses are ranked
PHOTOMETRIC_POINTS = 2500  # a side, of the views, that finish a refinement
LEAST_SCORE = 0.1  # V of a pose that the gate may accept; what is below is not looked at more closely

NO_TEXTURE = 0.2  # what stands in for the texture of a view without grey: less than a right pose usually has
WORST = -3.0  # V where there is nothing to look at
CERTAINLY = 2.0  # tolerances that leave no doubt


def verify(source: Sight, target: Sight, T_target_source: Array, sample: int | None = None) -> Verification:
    """Look at ``T_target_source`` from both views; ``sample`` limits the points that are asked on either side.

    Without it the grey is compared in the same image (`photometric`), with it in the images' own bands: quicker.
    A pose under which the views do not meet comes back with ``tested`` 0 and the lowest score.
    """
    ways = (
        count_visibility(source, target, T_target_source, sample),
        count_visibility(target, source, inverse(T_target_source), sample),
    )
    if min(way[SEEN] for way in ways) < 1:
        return Verification(inliers=0.0, violations=1.0, occluded=0.0, correlation=None, tested=0, score=WORST)
    grey = _grey(source, target, T_target_source, None if sample is None else ways[0] + ways[1])
    return Verification(
        inliers=float(min(way[INLIERS] / way[SEEN] for way in ways)),
        violations=float(max(way[VIOLATIONS] / way[SEEN] for way in ways)),
        occluded=float(max(way[OCCLUDED] / way[SEEN] for way in ways)),
        correlation=grey,
        tested=int(ways[0][SEEN] + ways[1][SEEN]),
        score=rated(ways[0], ways[1], NO_TEXTURE if grey is None else grey, _asked(source, target, sample)),
    )


def _grey(source: Sight, target: Sight, T: Array, counts: Array | None) -> float | None:
    """How the grey correlates, by ``counts`` where there are some; None for a view without grey."""
    if not (source.textured and target.textured):
        return None
    return correlate_views(source, target, T) if counts is None else correlation(counts)


def score_views(source: Sight, target: Sight, T_target_source: Array, sample: int) -> Array:
    """V of many poses (K, 4, 4) at once, from the first ``sample`` points a side; -3 where the views do not meet."""
    return score_counts(source, target, *count_both_ways(source, target, T_target_source, sample), sample)


def count_both_ways(source: Sight, target: Sight, T_target_source: Array, sample: int) -> tuple[Array, Array]:
    """`count_visibility` at many poses (K, 4, 4), forward and backward: (K, 10) each."""
    slops = depth_tolerance(source.noise, target.noise)
    forward = count_many(source.points[:sample], source.shades[:sample], T_target_source, *_image(target), *slops)
    back = inverses(T_target_source)
    return forward, count_many(target.points[:sample], target.shades[:sample], back, *_image(source), *slops)


def score_counts(source: Sight, target: Sight, forward: Array, backward: Array, sample: int) -> Array:
    """V (K,) of what `count_both_ways` counted, with the grey of each image's own band."""
    textured = source.textured and target.textured
    return np.asarray(_KERNELS.rated_many(forward, backward, textured, _asked(source, target, sample)))


def score_sharply(
    source: Sight,
    target: Sight,
    T_target_source: Array,
    ways: tuple[Array, Array],
    sample: int,
) -> float:
    """V of one pose (4, 4) with all of the source's grey laid into the target's image: slower, and it falls by more.

    ``ways`` are what `count_both_ways` counted there, (10,) each. Grey one way, as the other says much the same; for
    poses near each other, which separate a perturbation from none. Both views must have grey.
    """
    grey = correlation(compare(source, target, T_target_source, NARROW))
    return rated(*ways, grey, _asked(source, target, sample))


def _asked(source: Sight, target: Sight, sample: int | None) -> int:
    """How many points are asked, both ways."""
    return sum(min(len(sight.points), sample or len(sight.points)) for sight in (source, target))


def count_visibility(source: Sight, target: Sight, T_target_source: Array, sample: int | None) -> Array:
    """What the target view says of the source's points; the counts (10,) of `free_space.count`."""
    slops = depth_tolerance(source.noise, target.noise)
    return count(source.points[:sample], source.shades[:sample], T_target_source, *_image(target), *slops)


def certain_violations(source: Sight, target: Sight, T_target_source: Array) -> float:
    """The share of tested pixels that float beyond doubt, the worse way's: 1 where the views do not meet.

    In front of everything that the other view saw in a wide window, by more than twice the tolerance: edges are ragged
    and a right pose is a little off, but an object that is not there is larger than that.
    """
    ways = (source, target, T_target_source), (target, source, inverse(T_target_source))
    return max(_certain_violations(asked, seen, T) for asked, seen, T in ways)


def _certain_violations(asked: Sight, seen: Sight, T: Array) -> float:
    base, growth = depth_tolerance(asked.noise, seen.noise)
    slops = CERTAINLY * base, CERTAINLY * growth
    counts = count(asked.points, asked.shades, T, seen.front, seen.far, seen.detail, seen.camera, *slops)
    tested = count_visibility(asked, seen, T, None)[SEEN]
    return float(counts[VIOLATIONS] / tested) if tested >= 1 else 1.0


def _image(sight: Sight) -> tuple[Array, Array, Array, tuple[float, float, float, float]]:
    return sight.near, sight.far, sight.detail, sight.camera


def rated(forward: Array, backward: Array, grey: float, asked: int) -> float:
    """V of the counts (10,) of both ways, of which ``asked`` points were asked, and of the correlation of ``grey``.

    V is made of the worse way's inliers and violations, the texture and the share of all points that could be tested.
    The weights are set by hand, near those of a logistic fit; a view without grey counts as a weak match.
    """
    return float(_KERNELS.rated(forward, backward, grey, asked))


def rated_quickly(forward: Array, backward: Array, textured: bool, asked: int) -> float:
    """V with the grey of each image's own band."""
    return float(_KERNELS.rated_quickly(forward, backward, textured, asked))
