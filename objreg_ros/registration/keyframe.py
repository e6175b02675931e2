# SPDX-License-Identifier: Apache-2.0
"""The data types of the registrar: a keyframe, its objects and its context.

A keyframe is a place that was seen at one time: one or more frames that were close in time, fused in the camera frame
of one of them, its reference frame. It is what the store keeps and what the engine registers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud, View


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Context:
    """What is around the objects, thinned to voxels, in the camera frame of the keyframe.

    ``xyz (N, 3) float32`` m; ``normals (N, 3) float32`` of length 1 towards the camera (0 0 0: unknown); N may be 0.
    """

    xyz: Array
    normals: Array

    def __len__(self) -> int:
        return len(self.xyz)


def bounding_box(xyz: Array) -> tuple[Array, float]:
    """The middle (3,) float64 and the diagonal in m of the box around points (N, 3), N at least 1."""
    columns = np.ascontiguousarray(xyz.T, float)  # ten times faster to reduce than the rows
    low, high = columns.min(axis=1), columns.max(axis=1)
    return (low + high) / 2.0, float(np.linalg.norm(high - low))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KeyObject:
    """One object of a keyframe: its points from ``sightings`` frames, fused, in the camera frame of the keyframe."""

    cloud: ObjectCloud
    sightings: int = 1

    @property
    def label(self) -> str:
        """What the detector called it most often."""
        return self.cloud.label

    @property
    def centroid(self) -> Array:
        """The (3,) float64 middle of its bounding box: it shifts less with the viewing angle than the mean."""
        return bounding_box(self.cloud.xyz)[0]

    @property
    def extent(self) -> float:
        """The diagonal of its bounding box in m."""
        return bounding_box(self.cloud.xyz)[1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Keyframe:
    """A place with its objects, context and view, all in the camera frame of the reference frame at ``stamp_ns``.

    ``keyframe_id`` is unique in a store and grows with time, ``session`` counts the runs that wrote into it;
    ``gravity (3,)`` is of length 1 or None, and ``gravity_confidence`` 0..1 how much was seen that fixes it: next to
    nothing for one view, 1 for many from around. ``T_odom_camera`` is the pose of the reference frame in the frame of
    its session, and says something about another keyframe of the same session only: the odometry's where
    ``by_odometry``, else that of our own tracking, which may slip unnoticed. Until then the camera had gone
    ``travelled`` m and turned ``turned`` degrees in the session. ``robot`` carries the camera ``frame_id``.
    ``origin`` says which session of which run of a keyframer elsewhere it is of, empty for one of this process.
    """

    keyframe_id: int
    session: int
    stamp_ns: int
    frame_id: str
    objects: tuple[KeyObject, ...]
    context: Context
    view: View
    gravity: Array | None
    gravity_confidence: float
    T_odom_camera: Array | None
    by_odometry: bool = False
    travelled: float = 0.0
    turned: float = 0.0
    robot: str = ""
    origin: str = ""

    @property
    def camera(self) -> tuple[str, str]:
        """Which camera saw it: its robot and its frame."""
        return self.robot, self.frame_id

    @property
    def labels(self) -> tuple[str, ...]:
        """The label of each object, in their order."""
        return tuple(item.label for item in self.objects)

    @property
    def nbytes(self) -> int:
        """The memory of its points, pixels and colours."""
        arrays = [self.context.xyz, self.context.normals, self.view.xyz, self.view.grey]
        return sum(item.cloud.nbytes for item in self.objects) + sum(a.nbytes for a in arrays if a is not None)

    def numbered(self, keyframe_id: int) -> Keyframe:
        """The same keyframe under the id that a store gave it."""
        return replace(self, keyframe_id=keyframe_id)
