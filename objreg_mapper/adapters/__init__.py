# SPDX-License-Identifier: Apache-2.0
"""Nodes that hand constraints to the mappers of others: `docs/mappers.md` says which is for which.

`rtabmap`, `lio_sam`, `hydra` and `g2o` are one node each. `adapter` is what they share: closures come in once each and
wait for their consumer. `body` says where the camera sits, `odometry_in` follows odometry, `rtabmap_nodes` knows the
keyframes of RTAB-Map, `params` has the parameters, `diagnostics` what they report. What fills their messages is in
`objreg_mapper/formats/`.
"""
