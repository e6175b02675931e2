# SPDX-License-Identifier: Apache-2.0
"""Whether a stream is what it says of itself: camera, scale of depth, odometry and mount, measured from its own motion.

Every camera has a `StreamMonitor`, live and offline. What does not fit is a `Finding` that names the cause.
"""
