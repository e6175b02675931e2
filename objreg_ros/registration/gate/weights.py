# SPDX-License-Identifier: Apache-2.0
"""What each of the `kinds` of evidence weighs at its knots, in decimal logarithms; 0 is its average.

Written by `training/likelihood.py`, of 23665 pairs of keyframes in 36 simulated recordings.
"""

PRIOR = 0.099
WEIGHTS = {
    "tested": (-0.328, -0.236, -0.16, -0.018, 0.075),
    "certain_violations": (0.108, 0.108, 0.104, 0.038, -0.115, -0.356),
    "correlation": (-0.796, -0.721, -0.4, -0.149, 0.013, 0.089, 0.456),
    "silhouettes": (0.044, 0.044, 0.044, 0.134, 0.146),
    "matched": (-0.427, 0.049, 0.237, 0.36, 0.382, 0.382),
    "proposers": (-0.077, 0.119, 0.119),
    "score_margin": (-0.509, -0.46, -0.238, -0.088, 0.082, 0.204, 0.239, 0.297),
    "perturbation_margin": (-0.474, -0.164, 0.11, 0.246, 0.371, 0.46, 0.529),
    "position_sigma": (0.352, 0.331, 0.331, 0.216, -0.282),
    "scaled_sigma": (0.528, 0.517, 0.517, 0.41, 0.091, -0.321),
    "rmse": (0.167, 0.167, 0.131, -0.143, -0.381),
    "range": (0.09, 0.09, 0.09, -0.043, -0.046, -0.046),
}
UNKNOWN = {
    "tested": 0.0,
    "certain_violations": 0.0,
    "correlation": 0.0,
    "silhouettes": -0.185,
    "matched": 0.0,
    "proposers": 0.0,
    "score_margin": 0.0,
    "perturbation_margin": -0.296,
    "position_sigma": 0.0,
    "scaled_sigma": 0.0,
    "rmse": 0.0,
    "range": 0.0,
}
