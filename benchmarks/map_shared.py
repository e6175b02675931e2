# SPDX-License-Identifier: Apache-2.0
"""What if the closures of one keyframe share an error of that keyframe? Plain Levenberg-Marquardt with and without it.

A keyframe's picture is a little off its pose: in time, by blur, by calibration. Every closure of the keyframe has that
error. Here it is an unknown: each keyframe that a closure holds gets a second node, tied to the first loosely, and
closures are between second nodes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gtsam
import numpy as np
from map_peers import PEERS, Dense, factors_of, poses_of, values_of

from objreg_ros.data import Array
from objreg_ros.mapper.pose_graph import PoseGraph
from objreg_ros.report.trajectory_error import absolute_trajectory_error
from objreg_ros.truth import Truth


class Sigmas(NamedTuple):
    """How far a keyframe's picture is off its pose, in every axis."""

    metres: float
    degrees: float


TRIED = (Sigmas(0.005, 0.25), Sigmas(0.01, 0.5), Sigmas(0.02, 1.0), Sigmas(0.04, 2.0))


def with_pictures(dense: Dense, sigmas: Sigmas) -> Array:
    """The poses (n, 4, 4) of keyframes whose pictures have poses of their own."""
    count = len(dense.poses)
    seen = np.unique(np.concatenate([dense.closures.k1, dense.closures.k2]))
    factors, values = factors_of(dense.between_pictures(count)), values_of(dense.poses)
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([np.radians(sigmas.degrees), sigmas.metres], 3))
    for k in seen.tolist():
        values.insert(count + k, gtsam.Pose3(dense.poses[k]))
        factors.add(gtsam.BetweenFactorPose3(k, count + k, gtsam.Pose3(), noise))
    return poses_of(gtsam.LevenbergMarquardtOptimizer(factors, values).optimize(), count)


def errors_cm(graph: PoseGraph, truth: Truth) -> dict[str, float]:
    """The trajectory error of keyframes without pictures' errors, and with those of each size."""
    dense = Dense.of(graph)
    true: list[Any] = [truth.at(stamp) for stamp in graph.keyframes.stamps_ns]
    answers = {"plain LM": PEERS["GTSAM LM"](dense, 0.0).poses}
    for sigmas in TRIED:
        name = f"LM, keyframes off by {100 * sigmas.metres:g} cm, {sigmas.degrees:g} deg"
        answers[name] = with_pictures(dense, sigmas)
    return {name: 100 * absolute_trajectory_error(list(poses), true) for name, poses in answers.items()}
