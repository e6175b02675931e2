# SPDX-License-Identifier: Apache-2.0
"""One object upon another, both upright: a `shape` and its `silhouette`.

`silhouette_score` says how well two agree under a motion, `symmetry` whether a shape fixes its yaw. `upright_search`
tries every yaw, out of seen free space by the `visual_hull` and to its basin by `upright_icp`.
"""
