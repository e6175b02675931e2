# SPDX-License-Identifier: Apache-2.0
"""Poses from matched keypoints of the two views' grey: they need no object and no shape.

Where both views know gravity, pairs of matched points vote for poses (`pose_voting`): twice as many are right as by
PnP, as depth and gravity leave one turn to find. Without gravity the points of either view are seen in the other by
PnP with RANSAC (`cv2.USAC_DEFAULT`), which asks one of them for no depth.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_ros.registration.prepare.keypoints import KeypointMatches
from objreg_ros.registration.prepare.prepared import Pair
from objreg_ros.registration.propose.hypotheses import Hypothesis
from objreg_ros.registration.propose.pose_voting import Matches, poses

TOLERANCE_M = 0.1  # between matched points under a pose: the noise of depth far away
BASELINE_M = 0.15  # least between two points that vote
VOTED = 6  # most poses that votes give
LEAST_MATCHES = 6  # of which a pose is made
REPROJECTION_PX = 1.5  # of the view
ROUNDS = 200  # of RANSAC, at most
CONFIDENCE = 0.99


def from_keypoints(pair: Pair) -> list[Hypothesis]:
    """Poses from matched keypoints, those with most support first; none where few match."""
    matches, up_source, up_target = pair.keypoint_matches, pair.source.up, pair.target.up
    if len(matches) < LEAST_MATCHES:
        return []
    upright = up_source is not None and up_target is not None
    found = _by_votes(matches, up_source, up_target) if upright else _by_sight(matches)
    return [Hypothesis(T_target_source=T, proposer="keypoints", support=support) for T, support in found]


def _by_votes(
    matches: KeypointMatches, up_source: Array | None, up_target: Array | None
) -> Sequence[tuple[Array, float]]:
    source, target, a, b = matches
    known = source.measured[a] & target.measured[b]
    a, b = a[known], b[known]
    oriented = Matches(
        source=source.xyz[a],
        target=target.xyz[b],
        source_normals=source.normals[a],
        target_normals=target.normals[b],
        weights=np.ones(len(a)),
    )
    return poses(oriented, up_source, up_target, TOLERANCE_M, BASELINE_M, VOTED)


def _by_sight(matches: KeypointMatches) -> Sequence[tuple[Array, float]]:
    """The pose of source's points in target's picture, and of target's in source's."""
    found = []
    forth, back = _seen(matches), _seen(matches.turned())
    if forth is not None:
        found.append(forth)
    if back is not None:
        found.append((inverse(back[0]), back[1]))
    return sorted(found, key=lambda one: -one[1])


def _seen(matches: KeypointMatches) -> tuple[Array, float] | None:
    """The pose under which most points of source are seen where target has them, and how many; None for too few."""
    source, target, a, b = matches
    known = source.measured[a]
    xyz, uv = source.xyz[a[known]], target.rays[b[known]] * target.focal_px
    if len(xyz) < LEAST_MATCHES:
        return None
    camera = np.diag([target.focal_px, target.focal_px, 1.0])
    good, turn, shift, inliers = cv2.solvePnPRansac(
        xyz, uv, camera, None, iterationsCount=ROUNDS, reprojectionError=REPROJECTION_PX,
        confidence=CONFIDENCE, flags=cv2.USAC_DEFAULT,
    )  # fmt: skip
    if not good or inliers is None or len(inliers) < LEAST_MATCHES:
        return None
    T = pose(rotation_from_vector(turn.ravel()), shift.ravel())
    return (T, float(len(inliers))) if np.isfinite(T).all() else None
