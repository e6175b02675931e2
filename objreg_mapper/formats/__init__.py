# SPDX-License-Identifier: Apache-2.0
"""Constraints for other mappers, one file each. They fill messages that the caller makes and import none, so they need
no other package: ``rtabmap.fill_link(AddLink.Request().link, constraint, 12, 97)``.

A `LoopClosure` is between cameras, in their optical frames; what a mapper ties together are bodies. So Hydra's adapter
takes where the camera sits, RTAB-Map's links and g2o's edges take the `Constraint` between bodies that
`between_keyframes` makes, and LIO-SAM takes no pose. Only RTAB-Map's landmarks stay in the camera: TF places it.

`tum` and `kitti` write no constraints but the trajectory that came out of them.
"""
