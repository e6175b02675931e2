# SPDX-License-Identifier: Apache-2.0
"""Frames to keyframes: the `keyframer` says when one ends.

`tracking` is motion without odometry, begun with a guess of the `turn`; `odometry` is the path with it, and
`gravity_filter` gravity as all frames know it; `jitter` is how far that path scatters. `fusion` makes one keyframe of
the frames of a `frame_window`, and `own_size` bounds both; `recent` ones stay decoded. One that is sent is `quantised`,
has `fewer_points` if it must, and is written by `columns`; `node` is the node of a keyframer, `params` has the
parameters, `diagnostics` what the node reports.
"""
