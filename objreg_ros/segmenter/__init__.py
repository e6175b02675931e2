# SPDX-License-Identifier: Apache-2.0
"""Detections and a depth image in, a Frame of ObjectClouds and one reduced View out.

`segment` calls the steps in order. `sensor` brings what comes into one depth image and measures how it errs; `gravity`
is the direction of up, by level surfaces or by an IMU; `surface` has the cells, their parts and the planes that objects
stand on; `objects` are cut out of it, each in its detection box, and those without a name wherever they stand.
"""
