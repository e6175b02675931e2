# SPDX-License-Identifier: Apache-2.0
"""Odometry and IMU messages, and what they say at another time. Reads attributes only, as `from_msg`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from objreg_ros.bridge.messages.headers import bounded, when_and_where
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import FeltGravity, ImuSample, Odometry
from objreg_ros.geometry import interpolate, pose, rotation_from_quaternion

UNIT = 0.01  # how far from 1 the length of a quaternion may be that was meant as one


def odometry(message: Any) -> Odometry:
    """An Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped; ValueError without a rotation."""
    return Odometry(
        T_odom_body=motion(message),
        child_frame_id=bounded(getattr(message, "child_frame_id", ""), "child_frame_id"),
        **when_and_where(message),
    )


def pose_at(moment_ns: int, samples: Sequence[Odometry]) -> Array:
    """``T_odom_body (4, 4)`` at a time, between the two odometry samples that enclose it; of one sample its own.

    The nearer one's where their frames differ.
    """
    first, last = samples[0], samples[-1]
    if first.stamp_ns == last.stamp_ns:
        return first.T_odom_body
    if first.frame_id != last.frame_id:
        return (first if moment_ns - first.stamp_ns <= last.stamp_ns - moment_ns else last).T_odom_body
    share = (moment_ns - first.stamp_ns) / (last.stamp_ns - first.stamp_ns)
    return interpolate(first.T_odom_body, last.T_odom_body, min(1.0, max(0.0, share)))


def level_gravity(
    moment_ns: int, samples: Sequence[Odometry] | None, T_body_camera: Array | None = None
) -> Array | None:
    """The direction of gravity (3,) in the camera frame by an odometry whose frame is level with z up; else None.

    ``samples`` are the samples of `pose_at`. ``T_body_camera`` is the pose of the camera on the body of the odometry;
    the identity if None.
    """
    if not samples:
        return None
    T_level_body = pose_at(moment_ns, samples)
    T_level_camera = T_level_body if T_body_camera is None else T_level_body @ T_body_camera
    return -T_level_camera[2, :3]


def imu(message: Any) -> ImuSample:
    """An Imu; a field whose covariance begins with -1 is not measured (REP-145).

    Nor is an orientation that is no unit quaternion, or none but what an empty message holds. ValueError where what is
    measured is not finite.
    """
    return ImuSample(
        acceleration=_measured(message.linear_acceleration, "xyz", message.linear_acceleration_covariance),
        angular_velocity=_measured(message.angular_velocity, "xyz", message.angular_velocity_covariance),
        orientation=_orientation(message),
        orientation_sigma_deg=_tilt_deg(message.orientation_covariance),
        **when_and_where(message),
    )


def _measured(vector: Any, names: str, covariance: Any) -> Array | None:
    return None if covariance[0] < 0 else np.array([getattr(vector, name) for name in names], float)


def _orientation(message: Any) -> Array | None:
    xyzw = _measured(message.orientation, "xyzw", message.orientation_covariance)
    if xyzw is None or abs(float(np.linalg.norm(xyzw)) - 1.0) >= UNIT:
        return None
    is_empty = xyzw[3] == 1.0 and not np.any(message.orientation_covariance)
    return None if is_empty else xyzw / np.linalg.norm(xyzw)


def _tilt_deg(covariance: Any) -> float:
    """The standard deviation of roll and pitch, the larger one; 0 where it is not known."""
    variance = max(float(covariance[0]), float(covariance[4]))
    return float(np.degrees(np.sqrt(variance))) if 0.0 < variance < np.inf else 0.0


def gravity_at(moment_ns: int, samples: Sequence[FeltGravity]) -> FeltGravity:
    """The gravity at a time, between the two samples of a filter that enclose it; of one sample its own.

    Its confidence is the lower of the two. It is the nearer sample's where their frames differ.
    """
    first, last = samples[0], samples[-1]
    if first.stamp_ns == last.stamp_ns:
        return first
    share = min(1.0, max(0.0, (moment_ns - first.stamp_ns) / (last.stamp_ns - first.stamp_ns)))
    mean = (1.0 - share) * first.gravity + share * last.gravity
    length = float(np.linalg.norm(mean))
    if first.frame_id != last.frame_id or length < 0.5:
        return first if share <= 0.5 else last
    return FeltGravity(
        gravity=mean / length,
        gravity_sigma_deg=max(first.gravity_sigma_deg, last.gravity_sigma_deg),
        stamp_ns=moment_ns,
        frame_id=first.frame_id,
    )


def motion(message: Any) -> Array:
    """The (4, 4) motion of a message with a ``transform`` or a ``pose``, with covariance or without."""
    if hasattr(message, "transform"):
        where, turn = message.transform.translation, message.transform.rotation
    else:
        body = getattr(message.pose, "pose", message.pose)
        where, turn = body.position, body.orientation
    R = rotation_from_quaternion(np.array([turn.x, turn.y, turn.z, turn.w], float))
    return pose(R, np.array([where.x, where.y, where.z], float))
