# SPDX-License-Identifier: Apache-2.0
"""A constraint as a BetweenFactorPose3 of GTSAM (`pip install gtsam`).

Two conventions differ from ROS: GTSAM counts errors in the axes of *to*, and puts rotation before translation.
`local_information` turns the axes and `rotation_first` the order. The poses of the graph are those of the camera here;
`between_keyframes` moves a constraint to the poses of a body at your own keyframes.
"""

import numpy as np

from objreg_mapper.constraint import Constraint, local_information, rotation_first
from objreg_ros.data.closures import LoopClosure

try:
    import gtsam
except ImportError:
    raise SystemExit("expected gtsam, got none: pip install gtsam") from None


def factor(closure: LoopClosure, from_key: int, to_key: int) -> "gtsam.BetweenFactorPose3":
    """The factor between the poses of the camera at the two keyframes."""
    information = local_information(Constraint(closure.T_from_to, closure.covariance))
    noise = gtsam.noiseModel.Gaussian.Information(rotation_first(information))
    return gtsam.BetweenFactorPose3(from_key, to_key, gtsam.Pose3(closure.T_from_to), noise)


if __name__ == "__main__":
    T = np.eye(4)
    T[:3, 3] = 0.1, 0.0, 0.02
    covariance = np.diag([1e-4, 1e-4, 4e-4, 1e-6, 1e-6, 4e-6])
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 1e-3)))
    graph.add(factor(LoopClosure(from_ns=1, to_ns=2, T_from_to=T, covariance=covariance, labels=()), 0, 1))
    for key in (0, 1):
        start.insert(key, gtsam.Pose3())
    solved = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    print(f"solved: the second camera is at {np.round(solved.atPose3(1).translation(), 3).tolist()} m")
