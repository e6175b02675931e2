# SPDX-License-Identifier: Apache-2.0
"""Points thinned to voxels."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array


def thin(xyz: Array, normals: Array, voxel: float) -> tuple[Array, Array]:
    """The mean point and the mean, normalised normal of each occupied voxel, in a fixed order."""
    if len(xyz) == 0:
        return xyz, normals
    inverse_index, count = _voxels(xyz, voxel)
    mean = np.stack([np.bincount(inverse_index, xyz[:, k]) / count for k in range(3)], axis=1)
    sums = np.stack([np.bincount(inverse_index, normals[:, k]) for k in range(3)], axis=1)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return mean.astype(np.float32), (sums / np.maximum(length, 1e-9)).astype(np.float32)


def _keys(xyz: Array, voxel: float) -> Array:
    """One integer per point: its voxel among 2^21 along each axis."""
    cell = np.floor(xyz / voxel).astype(np.int64) + (1 << 20)
    return np.asarray((cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2])


def _voxels(xyz: Array, voxel: float) -> tuple[Array, Array]:
    _, index, count = np.unique(_keys(xyz, voxel), return_inverse=True, return_counts=True)
    return index.reshape(-1), count
