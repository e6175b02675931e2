# SPDX-License-Identifier: Apache-2.0
"""What is assumed of the sensor: how depth errs, in one place. Every room may import it.

The numbers are those of a structured-light camera (Kinect v1). Where two of them speak of the same thing they differ,
since each room was fitted with its own.
"""

from __future__ import annotations

import numpy as np

# Registration: the standard deviation of a depth z is DEPTH_NOISE_M + DEPTH_NOISE_GROWTH (z - NEAR_M)^2
# (Nguyen, Izadi and Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and tracking", 2012).
NEAR_M = 0.4  # where the noise of depth is least
DEPTH_NOISE_M = 0.0012
DEPTH_NOISE_GROWTH = 0.0019  # 1/m
DEPTH_WARP = 0.005  # error of depth that a patch of surface shares, as a share of its distance

# Tracking between frames: the standard deviation is TRACKING_SIGMA_M + TRACKING_SIGMA_GROWTH z^2.
TRACKING_SIGMA_M = 0.002
TRACKING_SIGMA_GROWTH = 0.003  # 1/m

# Segmentation: a point of a plane may lie PLANE_TOLERANCE_M + PLANE_TOLERANCE_GROWTH z^2 off it
# (Khoshelham and Elberink, "Accuracy and resolution of Kinect depth data", 2012).
PLANE_TOLERANCE_M = np.float32(0.008)
PLANE_TOLERANCE_GROWTH = np.float32(0.006)  # 1/m

# Silhouettes: two depths of one surface differ by SILHOUETTE_TOLERANCE_M + SILHOUETTE_TOLERANCE_GROWTH (z - NEAR_M)^2
# at most: 7 mm and three deviations of each.
SILHOUETTE_TOLERANCE_M = 0.0106
SILHOUETTE_TOLERANCE_GROWTH = 0.0057  # 1/m

# Free space: depths agree within DEPTH_TOLERANCE_M + DEPTH_TOLERANCE_GROWTH z^2.
DEPTH_TOLERANCE_M = 0.02
DEPTH_TOLERANCE_GROWTH = 0.006  # 1/m
