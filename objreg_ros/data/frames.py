# SPDX-License-Identifier: Apache-2.0
"""What one camera saw at one time, with the motion and the gravity beside it."""

from __future__ import annotations

from enum import IntFlag

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import (
    SURROGATE,
    Array,
    data_type,
    hold_array,
    hold_world_pose,
    require,
    require_reach,
)
from objreg_ros.data.images import Intrinsics

UNNAMED = "thing"  # the label of an object that the detector has no name for
JUMP_NS = 1_000_000_000  # stamps that go back this far are of a clock that began anew; by less, one message came late


class PointFlag(IntFlag):
    """What the segmenter knows of a point, or of the object that it belongs to (then all its points carry it)."""

    EDGE = 1  # the point is at a depth jump: its position is not to be trusted
    CUT_BY_IMAGE = 2  # the object leaves the image
    CUT_BY_BOX = 4  # the object leaves its detection box
    WALL_LIKE = 8  # a flat patch of something larger, not an object of its own
    UNSUPPORTED = 16  # no support surface was found under the object


@data_type
class ObjectCloud:
    """One segmented object in one frame, in the camera frame, with a ``score`` in 0..1.

    ``xyz (M, 3) float32`` m, within `limits.MOST_RANGE`; ``normals (M, 3) float32`` of length 1, towards the camera
    (0 0 0 where unknown);
    ``label`` is `UNNAMED` where the detector has no name for it;
    ``rgb (M, 3) uint8`` or None; ``flags (M,) uint16`` of `PointFlag`; ``density`` measured points per square metre of
    surface; ``instance`` counts the objects of the frame from 1 (0 is the support surface); ``detection_id`` is what
    the detector calls it, empty where it gives none.
    """

    label: str
    score: float
    instance: int
    xyz: Array
    normals: Array
    rgb: Array | None
    flags: Array
    density: float
    detection_id: str = ""

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {}
        hold_array(self, "xyz", np.float32, ("M", 3), sizes)
        hold_array(self, "normals", np.float32, ("M", 3), sizes)
        hold_array(self, "flags", np.uint16, ("M",), sizes)
        if self.rgb is not None:
            hold_array(self, "rgb", np.uint8, ("M", 3), sizes)
        require(self, len(self.label) <= limits.MOST_NAME, f"a label of at most {limits.MOST_NAME} characters", "more")
        require(self, not SURROGATE.search(self.label), "a label that UTF-8 can write", ascii(self.label))
        require(self, bool(np.isfinite(self.xyz).all()), f"finite points of {self.label!r}", "NaN or infinity")
        require_reach(self, self.xyz, f"points of {self.label!r}")
        longest = float(np.abs(self.normals).max(initial=0.0))
        normal = longest <= limits.MOST_NORMAL
        require(self, normal, f"normals of {self.label!r} of length 1 or 0", f"a part of {longest:g}")
        require(self, 0 <= self.score <= 1, f"a score of {self.label!r} in 0..1", self.score)
        dense = 0 <= self.density <= limits.MOST_DENSITY
        require(self, dense, f"a density of {self.label!r} of 0 to {limits.MOST_DENSITY:g}", self.density)

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def nbytes(self) -> int:
        """The memory of its points."""
        arrays = self.xyz, self.normals, self.rgb, self.flags
        return sum(array.nbytes for array in arrays if array is not None)

    def has(self, flag: PointFlag) -> bool:
        """Whether every point carries ``flag``; False without points."""
        return len(self) > 0 and bool((self.flags & flag).all())


@data_type
class View:
    """A frame at reduced size: what free space and texture are checked against, and what refinement holds on to.

    ``xyz (h, w, 3) float32`` m, from `limits.LEAST_RANGE` before the camera to `limits.MOST_RANGE`, NaN where nothing
    was measured; ``grey (h, w) uint8`` or None; ``intrinsics`` of the reduced camera.
    """

    xyz: Array
    grey: Array | None
    intrinsics: Intrinsics

    def __post_init__(self) -> None:
        sizes = {"h": self.intrinsics.height, "w": self.intrinsics.width}
        hold_array(self, "xyz", np.float32, ("h", "w", 3), sizes)
        if self.grey is not None:
            hold_array(self, "grey", np.uint8, ("h", "w"), sizes)
        size = self.intrinsics.width, self.intrinsics.height
        require(self, size[0] * size[1] <= limits.MOST_VIEW_PIXELS, f"at most {limits.MOST_VIEW_PIXELS} pixels", size)
        require_reach(self, self.xyz, "points")
        nearest = float(np.fmin.reduce(self.xyz[..., 2], axis=None, initial=np.inf))
        require(self, nearest >= limits.LEAST_RANGE, f"points at z = {limits.LEAST_RANGE:g} m or farther", nearest)


@data_type
class Frame:
    """The segmenter's output for one stamp.

    ``objects`` with instance >= 1; ``support`` the points of the surfaces they stand on (instance 0) or None;
    ``gravity (3,) float64`` of length 1, the direction of gravity in the camera frame, or None;
    ``gravity_confidence`` 0..1; ``T_odom_camera`` the odometry's pose of the camera or None; ``robot`` who carries the
    camera, empty where there is but one; ``doubt`` why the camera is not what it says, empty where nothing speaks
    against it; ``proven`` whether enough of the stream was seen for that.
    """

    objects: tuple[ObjectCloud, ...]
    support: ObjectCloud | None
    view: View
    gravity: Array | None
    gravity_confidence: float
    T_odom_camera: Array | None
    stamp_ns: int
    frame_id: str = "camera"
    robot: str = ""
    doubt: str = ""
    proven: bool = True

    def __post_init__(self) -> None:
        few = len(self.objects) <= limits.MOST_OBJECTS
        require(self, few, f"at most {limits.MOST_OBJECTS} objects", len(self.objects))
        if self.gravity is not None:
            hold_array(self, "gravity", np.float64, (3,), {})
            length = float(np.linalg.norm(self.gravity))
            require(self, abs(length - 1) < 1e-6, "gravity of length 1", length)
        if self.T_odom_camera is not None:
            hold_world_pose(self, "T_odom_camera")


@data_type
class ImuSample:
    """What an IMU measured at ``stamp_ns`` in the axes of ``frame_id``; None is what it does not measure.

    ``acceleration (3,) float64`` in m/s^2, against gravity at rest; ``angular_velocity (3,)`` in rad/s; ``orientation
    (4,)`` the unit quaternion x y z w of ``R_world_imu`` in a world with z up, and the standard deviation of its roll
    and pitch, 0 where that is not known.
    """

    acceleration: Array | None
    angular_velocity: Array | None
    orientation: Array | None
    stamp_ns: int
    orientation_sigma_deg: float = 0.0
    frame_id: str = ""

    def __post_init__(self) -> None:
        for name, length in (("acceleration", 3), ("angular_velocity", 3), ("orientation", 4)):
            values = getattr(self, name)
            if values is not None:
                hold_array(self, name, np.float64, (length,), {})
                require(self, bool(np.isfinite(values).all()), f"finite {name}", values.tolist())


@data_type
class FeltGravity:
    """The direction of gravity at ``stamp_ns`` from a source other than the picture, in the axes of ``frame_id``.

    ``gravity (3,) float64`` of length 1; ``gravity_sigma_deg`` the standard deviation of either tilt.
    """

    gravity: Array
    gravity_sigma_deg: float
    stamp_ns: int
    frame_id: str = ""

    def __post_init__(self) -> None:
        hold_array(self, "gravity", np.float64, (3,), {})
        length = float(np.linalg.norm(self.gravity))
        require(self, abs(length - 1) < 1e-6, "gravity of length 1", length)


@data_type
class Odometry:
    """The pose of a body in the odometry frame at ``stamp_ns``."""

    T_odom_body: Array
    stamp_ns: int
    frame_id: str = "odom"
    child_frame_id: str = "base_link"

    def __post_init__(self) -> None:
        hold_world_pose(self, "T_odom_body")
