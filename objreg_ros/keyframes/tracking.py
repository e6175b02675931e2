# SPDX-License-Identifier: Apache-2.0
"""The motion between two frames from their views, for frames that come without odometry.

The views are aligned densely: projective data association and point-to-plane error (Newcombe et al., "KinectFusion",
2011) together with the error of the grey (Steinbrücker et al., "Real-time visual odometry from dense RGB-D images",
2011), which holds where geometry alone slides along a plane. Robust weights (Huber) against what moved by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.native import kernels
from objreg_ros.registration.prepare.normals import view_normals
from objreg_ros.sensor import TRACKING_SIGMA_GROWTH, TRACKING_SIGMA_M

_KERNELS = kernels("tracking")
COARSE_TO_FINE = ((3, 0.20, 6), (2, 0.06, 10))  # stride in pixels, largest distance of a pair in metres, iterations
GREY_SIGMA = 10.0  # grey levels: noise, vignetting and the residue of exposure
LEAST_SHARE = 0.5  # of the pixels that land in the other view; less is another scene or a lost track
LEAST_PAIRS = 200
SAME_PICTURE = 0.8  # correlation of grey: right poses have more (370 looked at), of slipped ones 19 of 20 have less
SETTLED = 1e-4  # length of a last step, metres and radians


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackedSurface:
    """A view made ready to be aligned to: points, normals, grey and its slope, all (h, w, ...) float32."""

    xyz: Array
    normals: Array
    grey: Array
    slope: Array
    camera: Array  # fx fy cx cy
    has_grey: bool


def tracked_surface(view: View) -> TrackedSurface:
    """The view with its normals (0 0 0 where unknown) and the slope of its grey (0 without grey)."""
    shape = view.xyz.shape[:2]
    grey = np.zeros(shape, np.float32) if view.grey is None else view.grey.astype(np.float32)
    k = view.intrinsics
    return TrackedSurface(
        xyz=np.ascontiguousarray(view.xyz),
        normals=view_normals(view.xyz),
        grey=grey,
        slope=np.stack((np.gradient(grey, axis=1), np.gradient(grey, axis=0)), axis=-1),
        camera=np.array([k.fx, k.fy, k.cx, k.cy]),
        has_grey=view.grey is not None,
    )


def view_motion(source: View, target: TrackedSurface, T_target_source: Array | None = None) -> Array | None:
    """``T_target_source`` of two overlapping views from a guess (rest, if None); None where it does not settle.

    Made for neighbouring frames: it starts from the guess and finds motions of a few pixels.
    """
    T = np.eye(4) if T_target_source is None else T_target_source.astype(float)
    share = exposure = 0.0
    for stride, reach, iterations in COARSE_TO_FINE:
        xyz, grey = _thin(source, stride)
        grey_weight = 1.0 / GREY_SIGMA if target.has_grey and source.grey is not None else 0.0
        for _ in range(iterations):
            H, g, pairs, seen, brighter = _KERNELS.normal_equations(
                xyz, grey, T, target.xyz, target.normals, target.grey, target.slope, target.camera,
                reach, grey_weight, exposure, (TRACKING_SIGMA_M, TRACKING_SIGMA_GROWTH),
            )  # fmt: skip
            if pairs < LEAST_PAIRS:
                return None
            share, exposure = pairs / seen, exposure + brighter
            H = np.triu(H) + np.triu(H, 1).T
            step = -np.linalg.solve(H + 1e-6 * np.trace(H) * np.eye(6), g)
            T = pose(rotation_from_vector(step[3:]), step[:3]) @ T
            if np.abs(step).max() < SETTLED:
                break
    return T if share >= LEAST_SHARE else None


def same_picture(source: View, target: TrackedSurface, T_target_source: Array) -> float:
    """The correlation of the views' grey where one lies upon the other, -1 to 1; 0 where too little does.

    1, too, where what is left is noise, or one has no grey. Surfaces alone agree at other places too: a
    wall slides along itself.
    """
    if source.grey is None or not target.has_grey:
        return 1.0
    xyz, grey = _thin(source, 2)
    correlation, contrast = _KERNELS.correlation(xyz, grey, T_target_source, target.xyz, target.grey, target.camera)
    unexplained = contrast * np.sqrt(max(1.0 - correlation * correlation, 0.0))
    return 1.0 if unexplained <= GREY_SIGMA else float(correlation)


def _thin(view: View, stride: int) -> tuple[Array, Array]:
    xyz = view.xyz[::stride, ::stride].reshape(-1, 3)
    known = np.isfinite(xyz[:, 2])
    grey = np.zeros(len(xyz), np.uint8) if view.grey is None else view.grey[::stride, ::stride].reshape(-1)
    return np.ascontiguousarray(xyz[known]), grey[known].astype(np.float32)
