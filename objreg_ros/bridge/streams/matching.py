# SPDX-License-Identifier: Apache-2.0
"""Which messages belong to a view, and which to a frame: what a `Synchroniser` matches, live and from a recording."""

from __future__ import annotations

from objreg_ros.bridge.streams.sync import Need, Stream

ODOM_DEPTH = 1000  # odometry is small and many times as frequent as frames; so is an IMU's gravity


def view_streams(slop: float, from_points: bool, colour: bool, level_odom: bool) -> list[Stream]:
    """What belongs to a view within ``slop`` seconds: depth first, or a cloud (``from_points``).

    A cloud has its own colour, and may do without a camera. ``colour`` is whether depth takes it from a picture,
    ``level_odom`` whether gravity is odometry's, else an IMU's.
    """
    depth, detections = Stream("depth"), Stream("detections", slop_ns=round(1e9 * slop))
    streams = [depth, detections, _around("odom" if level_odom else "imu", slop)]
    if from_points:
        return streams
    image = [Stream("image", Need.OPTIONAL, round(1e9 * slop))] if colour else []
    return [*streams, Stream("camera_info", Need.LATCHED), *image]


def odometry_streams(slop: float, expected: bool = False, joints: bool = True) -> list[Stream]:
    """What goes with a frame within ``slop`` seconds: odometry around it, and the joints that carry the camera.

    ``expected`` is whether odometry is known to come.
    """
    return [_around("odom", slop, expected), *([_around("joints", slop)] if joints else [])]


def _around(name: str, slop: float, expected: bool = False) -> Stream:
    return Stream(name, Need.OPTIONAL, round(1e9 * slop), ODOM_DEPTH, enclosing=True, expected=expected)
