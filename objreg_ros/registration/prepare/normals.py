# SPDX-License-Identifier: Apache-2.0
"""The normals of a view, from its neighbouring pixels."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array


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
