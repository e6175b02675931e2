# SPDX-License-Identifier: Apache-2.0
"""How well a pose fits.

`view_score` is the verdict of both views, of `free_space` and the `photometric` correlation of their grey; without the
objects it is that of the `surroundings`. `object_matches` are the objects that lie upon themselves,
`keypoint_agreement` says how many keypoints do. `total_score` is of views and objects together, for a search, and
`comparison` of two poses near each other. `differing_parts` says which of two places a view shows.
"""
