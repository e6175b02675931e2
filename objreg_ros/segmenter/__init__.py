# SPDX-License-Identifier: Apache-2.0
"""Room 2: Detections and a depth image in, a Frame of ObjectClouds and one reduced View out.

`gravity_choice` decides between what the picture shows (`gravity`) and what an IMU feels (`imu`, by its `attitude`).
`unnamed` finds what stands there without a detection. `sensor_estimate` keeps what the stream tells of its sensor.
"""
