# SPDX-License-Identifier: Apache-2.0
"""Compiled loops: `projection` of points into a camera, `closest_points` of a surface, `least_squares`.

And when two poses are the `same_pose`.
"""
