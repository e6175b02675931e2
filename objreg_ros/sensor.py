# SPDX-License-Identifier: Apache-2.0
"""The assumptions on the sensor, in one place: how depth errs, and gravity. Every package may import it.

The numbers are those of a structured-light camera (Kinect v1). Where two of them describe one quantity they differ,
since each package was fitted with its own. What another camera errs by as much again is measured in every view
(`depth_noise`), and the registration's tolerances grow with it (`depth_tolerance`): nobody has to name a camera.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Registration: the standard deviation of a depth z is DEPTH_NOISE_M + DEPTH_NOISE_GROWTH (z - NEAR_M)^2
# (Nguyen, Izadi and Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and tracking", 2012).
NEAR_M = 0.4  # where the noise of depth is least
DEPTH_NOISE_M = 0.0012
DEPTH_NOISE_GROWTH = 0.0019  # 1/m
DEPTH_WARP = 0.005  # error of depth that a patch of surface shares, as a share of its distance

# Tracking between frames: the standard deviation is TRACKING_SIGMA_M + TRACKING_SIGMA_GROWTH z^2, for every camera:
# more for a noisier one gains nothing where grey holds the pose as well (docs/tried.md).
TRACKING_SIGMA_M = 0.002
TRACKING_SIGMA_GROWTH = 0.003  # 1/m

# Segmentation: a point of a plane may lie PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH z^2 off it
# (Khoshelham and Elberink, "Accuracy and resolution of Kinect depth data", 2012),
# for every camera: more for a noisier one makes segments worse (docs/tried.md).
PLANE_TOLERANCE_M = np.float32(0.008)
PLANE_TOLERANCE_GROWTH = np.float32(0.006)  # 1/m

# Silhouettes: two depths of one surface differ by SILHOUETTE_TOLERANCE_M + SILHOUETTE_TOLERANCE_GROWTH (z - NEAR_M)^2
# at most: 7 mm and three deviations of each.
SILHOUETTE_TOLERANCE_M = 0.0106
SILHOUETTE_TOLERANCE_GROWTH = 0.0057  # 1/m; `silhouette_tolerance` has both

# Free space: depths agree within DEPTH_TOLERANCE_M + DEPTH_TOLERANCE_GROWTH z^2.
DEPTH_TOLERANCE_M = 0.02
DEPTH_TOLERANCE_GROWTH = 0.006  # 1/m


SPAN = 3  # pixels of a view between the depths that are compared: block matching errs alike over fewer
SAME_SURFACE = 0.1  # share by which inverse depths on one surface differ at most over that
LEAST_TRIPLES = 200
NOISE_WIDTH = 160  # px: a picture is thinned to no less for its noise to be measured, as views are
KINECT = 1.25  # what `depth_noise` gives before it is divided by this: 1.1 in simulation, 1.1 to 1.25 with real ones
GAUSSIAN = 0.6745  # the median of what has a standard deviation of 1, regardless of its sign


def depth_noise(depth: NDArray[np.floating]) -> float:
    """How noisy the depth (h, w) m of a view is, in that of a Kinect v1; 1 where too little was measured, 0 is none.

    On a plane inverse depth is linear along rows and columns. What its second differences have is noise, but for edges
    and what is curved: so the median counts.
    """
    noise = measured_noise(depth)
    return 1.0 if noise is None else noise


def measured_noise(depth: NDArray[np.floating]) -> float | None:
    """The `depth_noise` of the depth (h, w) m of a view; None where too little was measured."""
    ratios = np.concatenate([_ratios(depth), _ratios(depth.T)])
    return None if len(ratios) < LEAST_TRIPLES else float(np.median(ratios)) / (GAUSSIAN * KINECT)


def thinned(depth: NDArray[np.floating]) -> NDArray[np.floating]:
    """The depth (h, w) of a picture with pixels left out, as many as leave it `NOISE_WIDTH` wide or more."""
    every = max(1, depth.shape[1] // NOISE_WIDTH)
    return depth[::every, ::every]


def _ratios(depth: NDArray[np.floating]) -> NDArray[np.floating]:
    """The second differences along columns, as deviations of a depth, in what a Kinect has at that depth: (K,)."""
    known = depth > 0.0
    nearness = np.divide(1.0, depth, out=np.zeros(depth.shape), where=known)
    a, b, c = nearness[: -2 * SPAN], nearness[SPAN:-SPAN], nearness[2 * SPAN :]
    flat = (a > 0.0) & (b > 0.0) & (c > 0.0) & (np.maximum(np.abs(a - b), np.abs(c - b)) < SAME_SURFACE * b)
    a, b, c = a[flat], b[flat], c[flat]
    return np.asarray(np.abs(a - 2.0 * b + c) / (np.sqrt(6.0) * b * b * depth_sigma(1.0 / b)))


def depth_sigma(depth: NDArray[np.floating], noise: float = 1.0) -> NDArray[np.floating]:
    """The standard deviation in m of depths (...) m, of a camera with that `depth_noise`, if more than a Kinect's."""
    beyond = np.maximum(0.0, np.asarray(depth, float) - NEAR_M)
    return np.asarray(max(1.0, noise) * (DEPTH_NOISE_M + DEPTH_NOISE_GROWTH * beyond**2))


def depth_tolerance(noise: float, other_noise: float) -> tuple[float, float]:
    """Within what depths z of two views agree: m, and its growth with z^2 in 1/m; wider for cameras with more noise."""
    both = np.sqrt(0.5 * (noise**2 + other_noise**2))
    return DEPTH_TOLERANCE_M, DEPTH_TOLERANCE_GROWTH * max(1.0, float(both))


def silhouette_tolerance(noise: float) -> NDArray[np.floating]:
    """(2,): within what depths z of a silhouette agree, m, and its growth with (z - NEAR_M)^2, 1/m."""
    return np.array([SILHOUETTE_TOLERANCE_M, SILHOUETTE_TOLERANCE_GROWTH * max(1.0, noise)])


# A confidence and the standard deviation of either tilt in degrees that it stands for, between which their logarithm is
# linear: as single views err in simulation with all sensors and stress, times 1.5 for rooms that are less level, and
# 0.5 at least (`training/gravity.py`). Below the first, gravity is no better than a guess, and counts as unknown.
CONFIDENCE = (0.3, 0.5, 0.7, 0.85, 0.94, 1.0)
SIGMA_DEG = (5.0, 4.0, 2.5, 0.95, 0.55, 0.5)


def gravity_sigma_deg(confidence: float) -> float:
    """The standard deviation in degrees of a gravity with this confidence 0..1; 90 below the least of `CONFIDENCE`."""
    if confidence < CONFIDENCE[0]:
        return 90.0
    return float(np.exp(np.interp(confidence, CONFIDENCE, np.log(SIGMA_DEG))))


def gravity_confidence(sigma_deg: float) -> float:
    """The confidence 0..1 of a gravity with this standard deviation in degrees, the inverse; 0 beyond the largest."""
    if not sigma_deg <= SIGMA_DEG[0]:
        return 0.0
    return float(np.interp(-np.log(max(sigma_deg, 1e-9)), -np.log(SIGMA_DEG), CONFIDENCE))


ONE_VIEW = 0.02  # weight of the gravity of a single view, beside 1 of many from around
MANY_VIEWS_DEG = 0.5  # standard deviation of the gravity of those


def session_gravity_sigma_deg(weight: float) -> float:
    """The standard deviation in degrees of either tilt of a keyframe's gravity, by its weight 0..1.

    It is of many views, carried by odometry (`keyframes/gravity_filter.py`), or of this one alone: then its weight is
    at most `ONE_VIEW`, which falls with the third power of the view's confidence.
    """
    if weight <= ONE_VIEW:
        return gravity_sigma_deg(float(np.cbrt(weight / ONE_VIEW)))
    return float(MANY_VIEWS_DEG / np.sqrt(weight))
