# SPDX-License-Identifier: Apache-2.0
"""The data types that pass between the nodes.

Every type but `Rejected` checks shape and dtype of its arrays when it is made and raises ValueError with what it
expected and what it got; the arrays are read-only. Points are float32 metres in the camera's optical frame (x right,
y down, z forward), poses float64, time integer nanoseconds, angles radians. A pose ``T_a_b`` maps points of b into a.
A failure is None, a `Rejected` or an exception. It is never a pose.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, IntFlag
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

from objreg_ros import limits

Array = NDArray[Any]

UNNAMED = "thing"  # the label of an object that the detector has no name for
LEAST_VARIANCE = 1e-30  # m^2, rad^2: the information of less is no number that can be reckoned with
JUMP_NS = 1_000_000_000  # stamps that go back this far are of a clock that began anew; by less, one message came late
MOVED = re.compile(r"moved (?P<label>.+) \[m\]")  # evidence: how far an object of the label went
SURROGATE = re.compile("[\ud800-\udfff]")  # halves of a character, as broken JSON has them
Data = TypeVar("Data")


@dataclass_transform(kw_only_default=True, frozen_default=True, eq_default=False, field_specifiers=(field,))
def data_type(cls: type[Data]) -> type[Data]:
    """The decorator of a data type: a frozen dataclass with keyword fields and slots."""
    return dataclass(frozen=True, slots=True, kw_only=True, eq=False)(cls)


def _hold(owner: Any, name: str, dtype: Any, shape: tuple[int | str | None, ...], sizes: dict[str, int]) -> None:
    """Check one array field and make it read-only. A size is a number, a name shared by fields, or None for any."""
    array = getattr(owner, name)
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{_expected(owner, name, dtype, shape)}, got {type(array).__name__}")
    wrong = array.dtype != dtype or array.ndim != len(shape)
    if not wrong:
        for got, size in zip(array.shape, shape, strict=True):
            wanted = sizes.setdefault(size, got) if isinstance(size, str) else size
            wrong = wrong or (wanted is not None and got != wanted)
    if wrong:
        known = {k: v for k, v in sizes.items() if k in shape}
        expected = _expected(owner, name, dtype, shape) + (f" with {known}" if known else "")
        raise ValueError(f"{expected}, got {array.dtype} of shape {array.shape}")
    view = array.view()
    view.flags.writeable = False
    object.__setattr__(owner, name, view)


def _expected(owner: Any, name: str, dtype: Any, shape: tuple[int | str | None, ...]) -> str:
    sizes = ", ".join("any" if size is None else str(size) for size in shape) + ("," if len(shape) == 1 else "")
    return f"{type(owner).__name__}.{name}: expected {np.dtype(dtype)} of shape ({sizes})"


def _hold_pose(owner: Any, name: str) -> None:
    _hold(owner, name, np.float64, (4, 4), {})
    T = getattr(owner, name)
    R = T[:3, :3]
    if not np.isfinite(T).all() or np.abs(R @ R.T - np.eye(3)).max() > 1e-4 or np.linalg.det(R) < 0:
        raise ValueError(f"{type(owner).__name__}.{name}: expected a rigid motion, got {T.tolist()}")


def _hold_place(owner: Any, name: str) -> None:
    """A pose in a world, which is somewhere in it."""
    _hold_pose(owner, name)
    farthest = float(np.abs(getattr(owner, name)[:3, 3]).max())
    _require(owner, farthest <= limits.MOST_DISTANCE, f"{name} within {limits.MOST_DISTANCE:g} m", f"{farthest:g} m")


def _require(owner: Any, truth: bool, expected: str, got: object) -> None:
    if not truth:
        raise ValueError(f"{type(owner).__name__}: expected {expected}, got {got}")


def _require_reach(owner: Any, xyz: Array, of: str) -> None:
    """No index into a grid or a picture is made of a coordinate beyond `limits.MOST_RANGE`; NaN is none."""
    farthest = float(np.fmax.reduce(np.abs(xyz), axis=None, initial=0.0))
    _require(owner, farthest <= limits.MOST_RANGE, f"{of} within {limits.MOST_RANGE:g} m", f"{farthest:g} m")


@data_type
class Intrinsics:
    """A pinhole camera without distortion: pixel ``u = fx x/z + cx``, pixel centres on integers."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def __post_init__(self) -> None:
        numbers = (self.fx, self.fy, self.cx, self.cy)
        _require(self, all(np.isfinite(numbers)), "finite fx fy cx cy", numbers)
        focal, centre = numbers[:2], numbers[2:]
        least, most = limits.LEAST_FOCAL_LENGTH, limits.MOST_FOCAL_LENGTH
        _require(self, min(focal) >= least and max(focal) <= most, f"focal lengths of {least} to {most:.0f} px", focal)
        _require(self, max(map(abs, centre)) <= most, f"a principal point within {most:.0f} px", centre)
        size = self.width, self.height
        _require(self, min(size) > 0, "a size above 0 px", size)
        _require(self, self.width * self.height <= limits.MOST_PIXELS, f"at most {limits.MOST_PIXELS} pixels", size)

    def scaled(self, step: int, first: tuple[int, int] | None = None) -> Intrinsics:
        """The camera that sees every ``step``-th pixel of each row and column.

        It starts at pixel ``first``, column and row, or at ``step // 2``.
        """
        left, top = first or (step // 2, step // 2)
        return Intrinsics(
            fx=self.fx / step,
            fy=self.fy / step,
            cx=(self.cx - left) / step,
            cy=(self.cy - top) / step,
            width=len(range(left, self.width, step)),
            height=len(range(top, self.height, step)),
        )

    def step_within(self, most_pixels: int) -> int:
        """The least step with which `scaled` leaves no more pixels than that."""
        step = 1
        while math.prod(max(1, len(range(step // 2, size, step))) for size in (self.width, self.height)) > most_pixels:
            step += 1
        return step


@data_type
class ColourImage:
    """``rgb (H, W, 3) uint8`` as a camera saw it at ``stamp_ns``."""

    rgb: Array
    stamp_ns: int
    frame_id: str = "camera"

    def __post_init__(self) -> None:
        _hold(self, "rgb", np.uint8, (None, None, 3), {})


def _span(low: float, high: float, size: int) -> slice:
    first, end = (min(max(edge, 0), size) for edge in (math.floor(low), math.ceil(high)))
    return slice(first, max(first, end))


@data_type
class Detections:
    """What the detector saw in one image: N boxes, best first, with the score and the label of each.

    ``xyxy (N, 4) float32`` pixels of the full image, half open (x_max and y_max are outside); ``score (N,) float32``
    in 0..1; ``label`` N names; ``image_hw`` the image's height and width. An image with no object gives N = 0.
    ``ids`` are what the detector, or a tracker in it, calls each of them; empty where it gives none. ``instances (H, W)
    uint16`` shows the same field of view in any size: k + 1 where the k-th object is, 0 where none; None for no masks.
    """

    xyxy: Array
    score: Array
    label: tuple[str, ...]
    image_hw: tuple[int, int]
    stamp_ns: int
    frame_id: str = "camera"
    ids: tuple[str, ...] = ()
    instances: Array | None = None

    def __post_init__(self) -> None:
        sizes = {"N": len(self.label)}
        _require(self, len(self.ids) in (0, len(self)), f"no ids, or one for each of {len(self)} boxes", len(self.ids))
        _hold(self, "xyxy", np.float32, ("N", 4), sizes)
        _hold(self, "score", np.float32, ("N",), sizes)
        _require(self, bool(np.isfinite(self.xyxy).all()), "finite boxes", self.xyxy)
        _require(self, bool(((self.score >= 0) & (self.score <= 1)).all()), "scores in 0..1", self.score)
        _require(self, min(self.image_hw) > 0, "an image size above 0 px", self.image_hw)
        _require(self, len(self) <= limits.MOST_DETECTIONS, f"at most {limits.MOST_DETECTIONS} boxes", len(self))
        if self.instances is not None:
            _hold(self, "instances", np.uint16, (None, None), {})
            _require(self, min(self.instances.shape) > 0, "instances of a size above 0 px", self.instances.shape)

    def __len__(self) -> int:
        return len(self.label)

    def instances_at(self, hw: tuple[int, int]) -> Array | None:
        """``instances`` in a picture of another height and width, by the nearest pixel."""
        if self.instances is None or self.instances.shape == hw:
            return self.instances
        pairs = zip(self.instances.shape, hw, strict=True)
        rows, columns = ((2 * np.arange(size) + 1) * own // (2 * size) for own, size in pairs)
        return self.instances[np.ix_(rows, columns)]

    def touched(self, k: int) -> tuple[slice, slice]:
        """Rows and columns of the picture's pixels that the k-th box touches; empty where it lies outside."""
        (height, width), (x_min, y_min, x_max, y_max) = self.image_hw, self.xyxy[k].tolist()
        return _span(y_min, y_max, height), _span(x_min, x_max, width)


@data_type
class PointCloud:
    """Points as a sensor sent them, before they become a `DepthImage`.

    ``xyz (H, W, 3) float32`` m, NaN where nothing was measured; H = 1 for an unorganised cloud; ``rgb`` (H, W, 3) uint8
    or None.
    """

    xyz: Array
    rgb: Array | None
    stamp_ns: int
    frame_id: str = "camera"

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {}
        _hold(self, "xyz", np.float32, ("H", "W", 3), sizes)
        if self.rgb is not None:
            _hold(self, "rgb", np.uint8, ("H", "W", 3), sizes)

    @property
    def organised(self) -> bool:
        """Whether rows and columns are those of an image."""
        return bool(self.xyz.shape[0] > 1)


@data_type
class DepthImage:
    """What the segmenter makes of every depth source.

    ``depth (H, W) float32`` metres along the optical axis, 0 to `limits.MOST_DEPTH`, 0 where there is none (never NaN);
    ``rgb (H, W, 3) uint8`` registered to it, or None; ``intrinsics`` of the same size; ``shown (H, W) bool`` to which
    pixels the sensor's picture reaches, where it was rectified and leaves some out, or None for all.
    """

    depth: Array
    rgb: Array | None
    intrinsics: Intrinsics
    stamp_ns: int
    frame_id: str = "camera"
    shown: Array | None = None

    def __post_init__(self) -> None:
        sizes = {"H": self.intrinsics.height, "W": self.intrinsics.width}
        if self.shown is not None:
            _hold(self, "shown", np.bool_, ("H", "W"), sizes)
        _hold(self, "depth", np.float32, ("H", "W"), sizes)
        if self.rgb is not None:
            _hold(self, "rgb", np.uint8, ("H", "W", 3), sizes)
        least, most = float(self.depth.min()), float(self.depth.max())  # NaN is within no bounds
        in_reach = least >= 0.0 and most <= limits.MOST_DEPTH
        _require(self, in_reach, f"depth of 0 to {limits.MOST_DEPTH:g} m", f"{least:g} to {most:g} m")


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
        _hold(self, "xyz", np.float32, ("M", 3), sizes)
        _hold(self, "normals", np.float32, ("M", 3), sizes)
        _hold(self, "flags", np.uint16, ("M",), sizes)
        if self.rgb is not None:
            _hold(self, "rgb", np.uint8, ("M", 3), sizes)
        _require(self, len(self.label) <= limits.MOST_NAME, f"a label of at most {limits.MOST_NAME} characters", "more")
        _require(self, not SURROGATE.search(self.label), "a label that UTF-8 can write", ascii(self.label))
        _require(self, bool(np.isfinite(self.xyz).all()), f"finite points of {self.label!r}", "NaN or infinity")
        _require_reach(self, self.xyz, f"points of {self.label!r}")
        longest = float(np.abs(self.normals).max(initial=0.0))
        normal = longest <= limits.MOST_NORMAL
        _require(self, normal, f"normals of {self.label!r} of length 1 or 0", f"a part of {longest:g}")
        _require(self, 0 <= self.score <= 1, f"a score of {self.label!r} in 0..1", self.score)
        dense = 0 <= self.density <= limits.MOST_DENSITY
        _require(self, dense, f"a density of {self.label!r} of 0 to {limits.MOST_DENSITY:g}", self.density)

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
        _hold(self, "xyz", np.float32, ("h", "w", 3), sizes)
        if self.grey is not None:
            _hold(self, "grey", np.uint8, ("h", "w"), sizes)
        size = self.intrinsics.width, self.intrinsics.height
        _require(self, size[0] * size[1] <= limits.MOST_VIEW_PIXELS, f"at most {limits.MOST_VIEW_PIXELS} pixels", size)
        _require_reach(self, self.xyz, "points")
        nearest = float(np.fmin.reduce(self.xyz[..., 2], axis=None, initial=np.inf))
        _require(self, nearest >= limits.LEAST_RANGE, f"points at z = {limits.LEAST_RANGE:g} m or farther", nearest)


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
        _require(self, few, f"at most {limits.MOST_OBJECTS} objects", len(self.objects))
        if self.gravity is not None:
            _hold(self, "gravity", np.float64, (3,), {})
            length = float(np.linalg.norm(self.gravity))
            _require(self, abs(length - 1) < 1e-6, "gravity of length 1", length)
        if self.T_odom_camera is not None:
            _hold_place(self, "T_odom_camera")


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
                _hold(self, name, np.float64, (length,), {})
                _require(self, bool(np.isfinite(values).all()), f"finite {name}", values.tolist())


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
        _hold(self, "gravity", np.float64, (3,), {})
        length = float(np.linalg.norm(self.gravity))
        _require(self, abs(length - 1) < 1e-6, "gravity of length 1", length)


@data_type
class Odometry:
    """The pose of a body in the odometry frame at ``stamp_ns``."""

    T_odom_body: Array
    stamp_ns: int
    frame_id: str = "odom"
    child_frame_id: str = "base_link"

    def __post_init__(self) -> None:
        _hold_place(self, "T_odom_body")


@data_type
class Alignment:
    """A registration and its evidence.

    ``information (6, 6) float64`` of the error ``[tx ty tz rx ry rz]`` in the target frame; ``inliers`` how many source
    points found a partner; ``overlap`` their share 0..1; ``rmse`` m of the inliers; ``degenerate (K, 6) float64`` unit
    directions of the same tangent space that the data leave open, K may be 0; ``regularised (L, 6) float64`` motions of
    one sigma along directions that only the look of the whole holds; ``middle (3,) float64`` m is that of what was
    aligned, in the target frame.
    """

    T_target_source: Array
    information: Array
    inliers: int
    overlap: float
    rmse: float
    converged: bool
    degenerate: Array = field(default_factory=lambda: np.zeros((0, 6)))
    regularised: Array = field(default_factory=lambda: np.zeros((0, 6)))
    middle: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        _hold_pose(self, "T_target_source")
        for name, shape in (
            ("middle", (3,)),
            ("information", (6, 6)),
            ("degenerate", (None, 6)),
            ("regularised", (None, 6)),
        ):
            _hold(self, name, np.float64, shape, {})


@data_type
class ObjectMatch:
    """An object that lies upon itself under a closure: its label and the id of its landmark."""

    label: str
    object_id: int


@data_type
class Observation:
    """An object as a keyframe saw it: its label, the id of its landmark, and its middle ``xyz (3,)`` m in the camera.

    The id stays the same over keyframes and sessions, until two landmarks turn out to be one: then the older one's
    stays.
    """

    label: str
    object_id: int
    xyz: Array

    def __post_init__(self) -> None:
        _hold(self, "xyz", np.float64, (3,), {})


Moments = tuple[str, int, str, int]  # of a closure: camera and stamp in ns of *from*, and of *to*
Robots = tuple[str, str]  # of a closure: that of *from* and that of *to*, empty where it is not known


def may_be_same(robots: Robots, others: Robots) -> bool:
    """Whether the robots of two closures are the same, as far as both are known."""
    return all(a == b or not a or not b for a, b in zip(robots, others, strict=True))


def framed(robot: str, frame_id: str) -> str:
    """A frame under the prefix of its robot, which it may have already."""
    return frame_id if not robot or frame_id.startswith(f"{robot}/") else f"{robot}/{frame_id}"


def robot_of(frame_id: str, robots: Sequence[str]) -> str:
    """The robot whose prefix a frame has, the longest name first; empty for none."""
    return next((robot for robot in sorted(robots, key=len, reverse=True) if frame_id.startswith(f"{robot}/")), "")


@data_type
class LoopClosure:
    """Two keyframes that saw the same place: ``T_from_to`` maps points of the camera at *to* into the camera at *from*.

    ``covariance (6, 6) float64`` in ROS order [tx ty tz rx ry rz], of the pose in the *from* frame; ``labels`` of the
    objects that closed it; ``matches`` those with their landmarks; ``evidence`` named numbers of the verification;
    ``from_frame_id`` and ``to_frame_id`` the names of the two cameras, which may be two of one robot; ``from_session``
    and ``to_session`` the runs of odometry that the keyframes belong to, None where it is not known; ``from_robot`` and
    ``to_robot`` the names of the robots whose runs these are, empty where they are not known.
    """

    from_ns: int
    to_ns: int
    T_from_to: Array
    covariance: Array
    labels: tuple[str, ...]
    matches: tuple[ObjectMatch, ...] = ()
    evidence: dict[str, float] = field(default_factory=dict)
    from_frame_id: str = "camera"
    to_frame_id: str = "camera"
    from_session: int | None = None
    to_session: int | None = None
    from_robot: str = ""
    to_robot: str = ""

    def __post_init__(self) -> None:
        _hold_pose(self, "T_from_to")
        _hold(self, "covariance", np.float64, (6, 6), {})
        C = self.covariance
        symmetric = bool(np.isfinite(C).all()) and bool(np.abs(C - C.T).max() <= 1e-6 * max(1e-12, np.abs(C).max()))
        _require(self, symmetric, "a finite, symmetric covariance", C.tolist())
        least = np.linalg.eigvalsh((C + C.T) / 2).min()
        _require(self, bool(least > LEAST_VARIANCE), "a positive definite covariance", C.tolist())

    @property
    def moments(self) -> Moments:
        """The identity of a closure: the same on every topic and at every publication."""
        return self.from_frame_id, self.from_ns, self.to_frame_id, self.to_ns

    @property
    def robots(self) -> Robots:
        """The robots of the two keyframes; the topic `constraints` does not carry them, objreg_msgs does."""
        return self.from_robot, self.to_robot

    @property
    def moved(self) -> dict[str, float]:
        """How far objects went that stood elsewhere before, m by label, from the evidence (see `MOVED`)."""
        found = ((MOVED.fullmatch(name), metres) for name, metres in self.evidence.items())
        return {name["label"]: metres for name, metres in found if name}


@data_type
class Relocalised:
    """Where the camera is in the map of an earlier ``session``: the frame that the poses of its keyframes are in.

    ``T_map_odom`` maps the odometry of now into it, ``T_map_camera`` is the camera of the frame at ``stamp_ns``;
    ``covariance (6, 6) float64`` of that in ROS order, along the map's axes; ``closures`` is how many agree on it, the
    newest to the keyframe of ``target_ns``: where that session's odometry has drifted, its map holds around there.
    ``by_odometry`` says that odometry gave both sessions' poses: the map is level then, else it is a camera's frame.
    """

    stamp_ns: int
    session: int
    target_ns: int
    T_map_odom: Array
    T_map_camera: Array
    covariance: Array
    closures: int
    by_odometry: bool = True

    def __post_init__(self) -> None:
        _hold_pose(self, "T_map_odom")
        _hold_pose(self, "T_map_camera")
        _hold(self, "covariance", np.float64, (6, 6), {})
        _require(self, bool(np.isfinite(self.covariance).all()), "a finite covariance", self.covariance.tolist())


class Reason(Enum):
    """Why something was refused. The value is what diagnostics and JSON show."""

    NO_CANDIDATE = "no_candidate"
    NO_HYPOTHESIS = "no_hypothesis"
    NOT_CONVERGED = "not_converged"
    LOW_OVERLAP = "low_overlap"
    FREE_SPACE = "free_space_violated"
    TEXTURE = "texture_disagrees"
    FEW_OBJECTS = "few_objects_matched"
    PROPOSERS_DISAGREE = "proposers_disagree"
    GRAVITY = "gravity_not_kept"
    IMPLAUSIBLE_MOTION = "implausible_motion"
    ODOMETRY = "odometry_disagrees"
    SLACK = "slides_along_a_plane"
    MOVED = "objects_moved"
    REDUNDANT = "redundant"
    OVER_BUDGET = "over_budget"
    UNREADABLE = "unreadable"
    CLOCK = "clock_began_anew"
    NEIGHBOURS = "neighbours_disagree"
    CAMERA = "camera_implausible"


UNTRIED = frozenset(
    {Reason.NO_CANDIDATE, Reason.REDUNDANT, Reason.OVER_BUDGET, Reason.UNREADABLE, Reason.CLOCK, Reason.CAMERA}
)
"""Reasons for which nothing was registered."""


@data_type
class Rejected:
    """A refused closure: the reason, and the numbers behind it in ``detail``.

    ``T_from_to (4, 4)`` is the pose that was turned down, unchecked, for a look at it and nothing else; None where none
    was found. ``evidence`` are named numbers of it. The frames, sessions and robots are as in `LoopClosure`, empty and
    None where they are not known.
    """

    reason: Reason
    from_ns: int
    to_ns: int
    detail: str
    T_from_to: Array | None = None
    evidence: dict[str, float] = field(default_factory=dict)
    from_frame_id: str = ""
    to_frame_id: str = ""
    from_session: int | None = None
    to_session: int | None = None
    from_robot: str = ""
    to_robot: str = ""
