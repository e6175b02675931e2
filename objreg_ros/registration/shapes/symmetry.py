# SPDX-License-Identifier: Apache-2.0
"""Whether an object's shape fixes its yaw: a can or a bowl looks the same however it is turned.

Its surface fixes it, or its outline: the round back of a chair lets it turn about the axis of the back, but then it
would stand where its camera saw through.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.registration.shapes.shape import Shape
from objreg_ros.registration.shapes.silhouette_score import COUNTS, VIOLATIONS, ask

TURN_SHARE = 0.16  # an object has no yaw if a smaller share of its surface resists a turn
TURN_VIOLATIONS = 0.14  # it has one after all if so much of it, turned about its axis, is in seen free space
TURNS = np.radians(np.arange(30, 360, 30))  # that an object is looked at under
LEAST = 10  # points that a yaw needs


def shows_yaw(cloud: ObjectCloud, up: Array | None, shape: Shape | None) -> bool:
    """Whether the surface of an object or its outline fixes its yaw; False where up is unknown."""
    if up is None:
        return False
    if yaw_share(cloud, up) >= TURN_SHARE:
        return True
    return shape is not None and turned_violations(shape) >= TURN_VIOLATIONS


def yaw_share(cloud: ObjectCloud, up: Array) -> float:
    """The share 0..1 of the yaw's information that a free horizontal shift leaves, of the most that a surface can give.

    0 for a surface of revolution about any upright axis, near 0.5 for a box; 1 where the cloud has no normals to ask.
    ``up (3,)`` is against gravity in the cloud's frame. It is the marginal of yaw in the normal equations of a
    point-to-plane registration with itself (Gelfand et al., "Geometrically stable sampling for the ICP algorithm",
    2003), divided by that of normals which all resist.
    """
    known = np.abs(cloud.normals).sum(axis=1) > 0.5
    if known.sum() < LEAST:
        return 1.0
    axes = np.stack(_horizontal(up), axis=1)
    left, most, _ = _turn(cloud.xyz[known] @ axes, cloud.normals[known] @ axes)
    return left / max(1e-12, most)


def turned_violations(shape: Shape) -> float:
    """The mean share 0..1 of points in seen free space over turns of a shape about the axis that suits its surface.

    Near 0 for a body of revolution, whatever of it was seen; 0 for few points.
    """
    level = shape.xyz[:, :2].astype(float), shape.normals[:, :2].astype(float)
    if len(shape.xyz) < LEAST:
        return 0.0
    _, _, axis = _turn(*level)
    shares, counts = [], np.empty(COUNTS)
    for turn in TURNS:
        c, s = np.cos(turn), np.sin(turn)
        motion = np.array([turn, *(axis - np.array([[c, -s], [s, c]]) @ axis), 0.0])
        asked = ask(shape.kernel_arrays, shape.kernel_arrays, motion, shape.extent, shape.most, counts)
        shares.append(counts[VIOLATIONS] / asked)
    return float(np.mean(shares))


def _turn(points: Array, normals: Array) -> tuple[float, float, Array]:
    """Of level points and normals (N, 2): the information of yaw that a free shift leaves, the most, and the axis."""
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    # Turning about c moves p by z x (p - c); along the normal that is n_y (x - c_x) - n_x (y - c_y): linear in c.
    resisted = normals[:, 1] * x - normals[:, 0] * y
    shift = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    c, *_ = np.linalg.lstsq(shift, resisted, rcond=1e-3)
    most = (np.square(normals).sum(axis=1) * (np.square(x - c[0]) + np.square(y - c[1]))).sum()
    return float(np.square(resisted - shift @ c).sum()), float(most), middle + c


def _horizontal(up: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that with ``up`` make a right-handed frame."""
    forward = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    forward /= np.linalg.norm(forward)
    return forward, np.cross(up, forward)
