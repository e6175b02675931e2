# SPDX-License-Identifier: Apache-2.0
"""Several stores become one: their keyframes under new numbers, their closures, and the closures between them.

`sources` are the stores that are read, under `robot_names` that no two of them share; `merging` copies them and ties
them together with `ties`, of which an `unfinished` merge knows how far it came. `one_map` solves all as one map, says
which closures it does not believe, and how true it is; `merge_page` shows that.
"""
