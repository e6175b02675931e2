# SPDX-License-Identifier: Apache-2.0
"""Frames to keyframes: the `keyframer` says when one ends.

`tracking` is motion without odometry, `odometry` the way that was gone with it, `gravity_filter` gravity as all frames
tell it; `fusion` makes one keyframe of the frames of a `frame_window`. A keyframe that is sent is `quantised`, has
`fewer_points` if it must, and is written by `columns`; `node` is the door of a keyframer, and `warm` compiles its
kernels.
"""
