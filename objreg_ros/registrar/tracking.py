# SPDX-License-Identifier: Apache-2.0
"""The motion between two moments from their views, for frames that come without odometry.

The views are aligned densely: projective data association and point-to-plane error (Newcombe et al., "KinectFusion",
2011) together with the error of the grey (Steinbrücker et al., "Real-time visual odometry from dense RGB-D images",
2011), which holds where geometry alone slides along a plane. Robust weights (Huber) against what moved by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data import Array, View
from objreg_ros.geometry import pose, rotation_from_vector, transform

COARSE_TO_FINE = ((3, 0.20, 5), (2, 0.06, 8))  # stride in pixels, largest distance of a pair in metres, iterations
GREY_SIGMA = 10.0  # grey levels: noise, vignetting and the residue of exposure
LEAST_SHARE = 0.5  # of the pixels that land in the other view; less is another scene or a lost track
LEAST_PAIRS = 200
SETTLED = 1e-5  # length of a last step, metres and radians


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """A view made ready to be aligned to: points, normals and grey with its slope, all (h, w, ...) float32."""

    view: View
    normals: Array
    grey: Array | None
    slope: Array | None


def surface_of(view: View) -> Surface:
    """The view with its normals (0 0 0 where unknown) and the slope of its grey."""
    grey = None if view.grey is None else view.grey.astype(np.float32)
    slope = None if grey is None else np.stack((np.gradient(grey, axis=1), np.gradient(grey, axis=0)), axis=-1)
    return Surface(view=view, normals=view_normals(view.xyz), grey=grey, slope=slope)


def view_normals(xyz: Array) -> Array:
    """(h, w, 3) float32 normals towards the camera of organised points, 0 0 0 beside holes and depth jumps."""
    right, down = np.full_like(xyz, np.nan), np.full_like(xyz, np.nan)
    right[:, 1:-1] = xyz[:, 2:] - xyz[:, :-2]
    down[1:-1] = xyz[2:] - xyz[:-2]
    jump = 0.05 + 0.03 * xyz[..., 2] ** 2
    normals = np.cross(down, right)
    length = np.linalg.norm(normals, axis=-1)
    with np.errstate(invalid="ignore"):
        known = (length > 0) & (np.abs(right[..., 2]) < jump) & (np.abs(down[..., 2]) < jump)
        normals /= np.where(known, length, 1.0)[..., None]
        normals[(normals * xyz).sum(axis=-1) > 0] *= -1
    normals[~known] = 0
    return np.asarray(normals, np.float32)


def view_motion(source: View, target: Surface, T_target_source: Array | None = None) -> Array | None:
    """``T_target_source`` of two overlapping views from a guess (rest, if None); None where it does not settle.

    Made for neighbouring frames: it starts from the guess and finds motions of a few pixels.
    """
    T = np.eye(4) if T_target_source is None else T_target_source.copy()
    share = 0.0
    for stride, reach, iterations in COARSE_TO_FINE:
        xyz, grey = _thin(source, stride)
        for _ in range(iterations):
            pairs = _pair(transform(T, xyz), grey, target, reach)
            if pairs is None:
                return None
            step, share = _step(pairs), pairs.share
            T = pose(rotation_from_vector(step[3:]), step[:3]) @ T
            if np.abs(step).max() < SETTLED:
                break
    return T if share >= LEAST_SHARE else None


@dataclass(slots=True, eq=False)
class _Pairs:
    """Source points (P, 3) in the target frame, the target's normals there, the two errors and their scales."""

    xyz: Array
    normals: Array
    distance: Array
    grey_error: Array | None
    grey_gradient: Array | None
    share: float


def _thin(view: View, stride: int) -> tuple[Array, Array | None]:
    xyz = view.xyz[::stride, ::stride].reshape(-1, 3)
    known = np.isfinite(xyz[:, 2])
    grey = None if view.grey is None else view.grey[::stride, ::stride].reshape(-1)[known].astype(np.float32)
    return xyz[known], grey


def _pair(xyz: Array, grey: Array | None, target: Surface, reach: float) -> _Pairs | None:
    camera = target.view.intrinsics
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.rint(camera.fx * xyz[:, 0] / xyz[:, 2] + camera.cx)
        v = np.rint(camera.fy * xyz[:, 1] / xyz[:, 2] + camera.cy)
        inside = (xyz[:, 2] > 0.1) & (u >= 0) & (v >= 0) & (u < camera.width) & (v < camera.height)
    rows, columns = v[inside].astype(np.intp), u[inside].astype(np.intp)
    normals = target.normals[rows, columns]
    known = normals.any(axis=1)
    distance = ((xyz[inside] - target.view.xyz[rows, columns]) * normals).sum(axis=1)
    kept = known & (np.abs(distance) < reach)
    if kept.sum() < LEAST_PAIRS:
        return None
    points, rows, columns = xyz[inside][kept], rows[kept], columns[kept]
    share = float(kept.sum() / known.sum())
    pairs = _Pairs(points, normals[kept], distance[kept], None, None, share)
    if grey is not None and target.grey is not None:
        _add_grey(pairs, grey[inside][kept], target, rows, columns)
    return pairs


def _add_grey(pairs: _Pairs, grey: Array, target: Surface, rows: Array, columns: Array) -> None:
    """The grey's error to first order between the projected point and the centre of its pixel, exposure removed."""
    assert target.grey is not None and target.slope is not None
    camera, slope = target.view.intrinsics, target.slope[rows, columns]
    x, y, z = pairs.xyz.T
    du = camera.fx * x / z + camera.cx - columns
    dv = camera.fy * y / z + camera.cy - rows
    error = target.grey[rows, columns] + slope[:, 0] * du + slope[:, 1] * dv - grey
    a, b = camera.fx * slope[:, 0] / z, camera.fy * slope[:, 1] / z
    pairs.grey_error = error - np.median(error)
    pairs.grey_gradient = np.stack([a, b, -(a * x + b * y) / z], axis=1)


def _step(pairs: _Pairs) -> Array:
    """One Gauss-Newton step (6,) [t r] of the motion that multiplies from the left."""
    sigma = 0.002 + 0.003 * pairs.xyz[:, 2] ** 2
    H, g = _normal_equations(pairs.xyz, pairs.normals, pairs.distance, sigma)
    if pairs.grey_error is not None and pairs.grey_gradient is not None:
        H_grey, g_grey = _normal_equations(pairs.xyz, pairs.grey_gradient, pairs.grey_error, GREY_SIGMA)
        H, g = H + H_grey, g + g_grey
    return np.asarray(-np.linalg.solve(H + 1e-6 * np.trace(H) * np.eye(6), g))


def _normal_equations(xyz: Array, gradient: Array, error: Array, sigma: Array | float) -> tuple[Array, Array]:
    """``J^T W J`` and ``J^T W e`` of an error with a (P, 3) gradient at moving points, Huber weights at 1.3 sigma."""
    scaled = np.abs(error) / sigma
    weight = np.minimum(1.0, 1.3 / np.maximum(scaled, 1e-6)) / np.square(sigma)
    J = np.hstack([gradient, np.cross(xyz, gradient)])
    weighted = J * np.asarray(weight)[:, None]
    return (weighted.T @ J).astype(float), (weighted.T @ error).astype(float)
