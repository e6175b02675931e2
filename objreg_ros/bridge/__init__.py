# SPDX-License-Identifier: Apache-2.0
"""The border to ROS. No algorithm lives here.

`messages` converts messages to data types and back, `node` is what every node has, `camera` what a camera is and where
it sits, `streams` brings inputs together and publishes. Each imports only those before it.
"""
