# SPDX-License-Identifier: Apache-2.0
"""What each of the `kinds` of evidence weighs at its knots, in decimal logarithms; 0 is its average.

Written by `training/likelihood.py`, of 41634 pairs of keyframes in 63 simulated recordings.
"""

PRIOR = 0.034
WEIGHTS = {
    "tested": (-0.364, -0.281, -0.193, -0.044, 0.097),
    "certain_violations": (0.122, 0.122, 0.122, 0.062, -0.094, -0.451),
    "correlation": (-0.816, -0.771, -0.516, -0.272, -0.058, 0.128, 0.515),
    "silhouettes": (0.033, 0.039, 0.039, 0.13, 0.158),
    "matched": (-0.368, 0.063, 0.203, 0.306, 0.314, 0.323),
    "proposers": (-0.05, 0.075, 0.075),
    "score_margin": (-0.532, -0.466, -0.236, -0.075, 0.106, 0.252, 0.298, 0.304),
    "perturbation_margin": (-0.472, -0.126, 0.12, 0.244, 0.34, 0.408, 0.435),
    "position_sigma": (0.441, 0.412, 0.369, 0.175, -0.325),
    "scaled_sigma": (0.477, 0.463, 0.458, 0.35, 0.09, -0.293),
    "rmse": (0.194, 0.194, 0.146, -0.148, -0.461),
    "range": (0.107, 0.107, 0.107, -0.053, -0.053, -0.053),
}
UNKNOWN = {
    "tested": 0.0,
    "certain_violations": 0.0,
    "correlation": 0.0,
    "silhouettes": -0.194,
    "matched": 0.0,
    "proposers": 0.0,
    "score_margin": 0.0,
    "perturbation_margin": -0.252,
    "position_sigma": 0.0,
    "scaled_sigma": 0.0,
    "rmse": 0.0,
    "range": 0.0,
}
