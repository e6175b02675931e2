# SPDX-License-Identifier: Apache-2.0
"""The camera that a camera_info or a cloud states, as intrinsics. Reads attributes only, as `from_msg`."""

from __future__ import annotations

from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics, PointCloud
from objreg_ros.plausibility.pinhole import differ, likelier

COLUMNS = {"p": 4, "k": 3}  # of the matrices of a camera_info


def intrinsics(message: Any) -> Intrinsics:
    """The pinhole camera of a CameraInfo, with its binning and region of interest applied.

    It is the projection matrix P, by which rectified and registered pictures are made (image_geometry's
    PinholeCameraModel), and K where P is left at zeros, or cannot be that of the picture as K can. ValueError
    for a camera that is not calibrated (ROS drivers say so with zeros in both).
    """
    camera = _windowed(_calibrated(message), message)
    other = disagreeing_k(message)
    return camera if other is None else likelier(camera, other)


def disagreeing_k(message: Any) -> Intrinsics | None:
    """The camera of K where P is another one that it cannot be; None where the two agree, or may differ.

    They may where there is something to rectify (D, R), as far as P can be the camera of the picture too.
    """
    K, P, R = _camera_matrix(message, "k"), _camera_matrix(message, "p"), _numbers(message, "r")
    if K[0, 0] == 0 or P[0, 0] == 0 or np.array_equal(K, P[:, :3]):
        return None
    try:
        k, p = pinhole(message, "k"), pinhole(message, "p")
    except ValueError:
        return None
    is_turned = R.any() and not np.allclose(R, np.eye(3).ravel(), atol=1e-6)
    if np.any(_numbers(message, "d")) or is_turned:
        return k if likelier(p, k) is k else None
    return k if differ(p, k) else None


def _numbers(message: Any, name: str) -> Array:
    values = getattr(message, name) if hasattr(message, name) else getattr(message, name.upper(), ())  # as in ROS 1
    return np.asarray(values, np.float64).ravel()


def pinhole(message: Any, name: str) -> Intrinsics:
    """The pinhole camera of one matrix of a CameraInfo, ``k`` or ``p``, with binning and region of interest applied.

    ValueError where that one is not calibrated.
    """
    return _windowed(_usable(message, name), message)


def _windowed(matrix: Array, message: Any) -> Intrinsics:
    roi, (bin_x, bin_y) = message.roi, (max(1, int(b)) for b in (message.binning_x, message.binning_y))
    width, height = int(roi.width) or int(message.width), int(roi.height) or int(message.height)
    return Intrinsics(
        fx=float(matrix[0, 0]) / bin_x,
        fy=float(matrix[1, 1]) / bin_y,
        cx=(float(matrix[0, 2]) - int(roi.x_offset)) / bin_x,
        cy=(float(matrix[1, 2]) - int(roi.y_offset)) / bin_y,
        width=width // bin_x,
        height=height // bin_y,
    )


def is_calibrated(message: Any) -> bool:
    """Whether a CameraInfo says anything of its camera: drivers leave K and P at zeros until somebody calibrated it."""
    return any(_camera_matrix(message, name).flat[0] != 0 for name in "pk")


def camera_of_cloud(
    camera_info: Any, cloud: PointCloud, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE
) -> Intrinsics | None:
    """The camera that a cloud is organised or projected with; None without a ``camera_info``.

    None too for one that is not calibrated where the cloud is organised, since that needs none; else ValueError.
    """
    if camera_info is None or (cloud.organised and not is_calibrated(camera_info)):
        return None
    camera = intrinsics(camera_info)
    if camera.width * camera.height > most_pixels:
        raise ValueError(f"camera_info: expected at most {most_pixels} pixels, got {camera.width} × {camera.height}")
    return camera


def _calibrated(message: Any) -> Array:
    """P (3, 4) or, where it says nothing, K (3, 3), in pixels of the whole picture; ValueError if neither is usable."""
    return _usable(message, "p" if _camera_matrix(message, "p").flat[0] != 0 else "k")


def _usable(message: Any, name: str) -> Array:
    matrix = _camera_matrix(message, name)
    if not np.isfinite(matrix).all() or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        got = matrix.ravel().tolist()
        raise ValueError(f"camera_info: expected a calibrated {name.upper()} with focal lengths above 0, got {got}")
    return matrix


def _camera_matrix(message: Any, name: str) -> Array:
    values = getattr(message, name) if hasattr(message, name) else getattr(message, name.upper())  # as in ROS 1
    return np.asarray(values, np.float64).reshape(3, COLUMNS[name])
