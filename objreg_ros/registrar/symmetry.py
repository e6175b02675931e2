# SPDX-License-Identifier: Apache-2.0
"""Whether an object's own surface tells its yaw: a can or a bowl looks the same however it is turned."""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array, ObjectCloud


def yaw_share(cloud: ObjectCloud, up: Array) -> float:
    """The share 0..1 of the yaw's information that a free horizontal shift leaves, of the most that a surface can give.

    0 for a surface of revolution about any upright axis, near 0.5 for a box; 1 where the cloud has no normals to ask.
    ``up (3,)`` is against gravity in the cloud's frame. It is the marginal of yaw in the normal equations of a
    point-to-plane registration with itself (Gelfand et al., "Geometrically stable sampling for the ICP algorithm",
    2003), divided by that of normals which all resist.
    """
    known = np.abs(cloud.normals).sum(axis=1) > 0.5
    if known.sum() < 10:
        return 1.0
    forward, left = _horizontal(up)
    axes = np.stack([forward, left], axis=1)
    points, normals = cloud.xyz[known] @ axes, cloud.normals[known] @ axes
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    # Turning about c moves p by z x (p - c); along the normal that is n_y (x - c_x) - n_x (y - c_y): linear in c.
    resisted = normals[:, 1] * x - normals[:, 0] * y
    shift = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    c, *_ = np.linalg.lstsq(shift, resisted, rcond=1e-3)
    most = (np.square(normals).sum(axis=1) * (np.square(x - c[0]) + np.square(y - c[1]))).sum()
    return float(np.square(resisted - shift @ c).sum() / max(1e-12, float(most)))


def _horizontal(up: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that with ``up`` make a right-handed frame."""
    forward = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    forward /= np.linalg.norm(forward)
    return forward, np.cross(up, forward)
