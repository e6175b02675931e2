# SPDX-License-Identifier: Apache-2.0
"""A recording through detector, segmenter and registrar without ROS.

`stages` says what the three are, `line` passes messages through them, `run` holds what came out, as JSON too, with the
`outlines` of objects.
"""
