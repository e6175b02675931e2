# SPDX-License-Identifier: Apache-2.0
"""Which of two poses near each other has the better score of views and objects.

The silhouette score of an object separates front from back, but not half a degree: whether a thin leg falls beside
its pixels is chance. Grey that both views see much of locates a pose exactly, and grey that they see little of
does not. So the objects count as far as the grey leaves doubt.
"""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data.checked import Array
from objreg_ros.registration.candidate import Verification
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.score.object_matches import Pairs, score_matched_silhouettes
from objreg_ros.registration.score.view_score import PHOTOMETRIC_POINTS, verify

SILHOUETTE_WEIGHT = 0.5  # of the silhouette score of matched objects, beside V
TELLING_GREY = 1000.0  # n r / (1 - r^2) of n points whose grey correlates by r, beyond which objects have less say


class LocalScore(NamedTuple):
    """What the views say of a pose, and how alike the matched objects look under it.

    ``silhouette_score`` is -1 to 1, and 0 where no matched object has a shape.
    """

    seen: Verification
    silhouette_score: float


def score_locally(source: Prepared, target: Prepared, T_target_source: Array, matched: Pairs) -> LocalScore:
    """What the views, by `PHOTOMETRIC_POINTS` a side, and the ``matched`` objects say of a pose (4, 4)."""
    seen = verify(source.sight, target.sight, T_target_source, PHOTOMETRIC_POINTS)
    return LocalScore(seen, score_matched_silhouettes(source, target, matched, T_target_source) or 0.0)


def score_gain(other: LocalScore, own: LocalScore) -> float:
    """How much higher another pose scores than one's own, in units of V; below 0 where it scores lower.

    Both are of the same matched objects. The surer grey counts for both, so that one gains what the other loses.
    """
    doubt = min(_doubt(score.seen) for score in (other, own))
    more_alike = other.silhouette_score - own.silhouette_score
    return other.seen.score - own.seen.score + SILHOUETTE_WEIGHT * doubt * more_alike


def _doubt(seen: Verification) -> float:
    """How little the grey says of where exactly a pose is: 0 where it says all, 1 where objects may say as much.

    The log likelihood of jointly Gaussian greys that correlate by r over n points, -n/2 log(1 - r^2), changes by
    n r / (1 - r^2) with r. The n points are those that lie on a surface of both.
    """
    r, n = min(max(seen.correlation or 0.0, 0.0), 1.0), seen.inliers * seen.tested
    known, enough = n * r, TELLING_GREY * (1.0 - r**2)
    return enough / known if known > enough else 1.0
