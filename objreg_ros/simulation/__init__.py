# SPDX-License-Identifier: Apache-2.0
"""A Kinect over rooms of objects, with ground truth; it writes ordinary recordings."""
