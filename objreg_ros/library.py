# SPDX-License-Identifier: Apache-2.0
"""The registration of two pictures, without ROS and without a store: what `import objreg_ros` offers.

Two pictures, clouds or lists of frames go through the segmenter, become keyframes and are aligned. Lengths are metres,
points are in the camera's optical frame (x right, y down, z forward), ``T_a_b`` maps points of b into a.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from objreg_ros import share
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import ColourImage, DepthImage, Detections, Intrinsics, PointCloud
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.geometry import inverse
from objreg_ros.keyframes.frame_window import FrameWindow, alone
from objreg_ros.keyframes.fusion import fuse, reference_index
from objreg_ros.lens import Lens
from objreg_ros.registration import align
from objreg_ros.registration.api import Gate, Method
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.result import Registration
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.sensor.organise import FAR, CloudError, organise
from objreg_ros.terminal import progress

NO_DEPTH_MM = 65535  # what drivers send where nothing was measured, beside 0
CLOUD = "give points in metres in the optical frame of the camera that saw them (x right, y down, z forward)"

Found = Detections | Sequence[tuple[Any, str, float]]
"""Detections, or ``(where, label, score)`` of each object: where is a box x_min y_min x_max y_max in pixels, half open,
or a mask (H, W) bool of the picture; the score is in 0..1."""
Detects = Callable[[Array], Found]
"""A detector of one's own: ``rgb (H, W, 3) uint8`` in, what it found out."""


@dataclass(frozen=True)
class Camera:
    """A camera in pixels: ``u = fx x/z + cx``, pixel centres on integers.

    ``distortion`` are the coefficients of its lens in OpenCV's order and ``model`` says of which: ``plumb_bob`` 4, 5,
    8, 12 or 14, ``rational_polynomial`` 8, 12 or 14, ``equidistant`` 4. Pictures are rectified by them, and what was
    detected in these. None or zeros: the pictures are taken as rectified. Clouds are metres already: nothing of them is
    rectified.

    ``width`` and ``height`` are those of the picture where they are 0; only clouds that are no pictures need them.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int = 0
    height: int = 0
    distortion: tuple[float, ...] = ()
    model: str = "plumb_bob"

    def lens(self, height: int, width: int) -> Lens | None:
        """The lens of a picture of this size, None without one; ValueError for one that is unknown or cannot be."""
        if not any(self.distortion):
            return None
        camera = self.intrinsics(height, width)
        return Lens(self.model, tuple(map(float, self.distortion)), camera, camera)

    def intrinsics(self, height: int, width: int) -> Intrinsics:
        """The camera of a picture of this size; ValueError where it is said to be of another."""
        given = self.height or height, self.width or width
        if given != (height, width):
            raise ValueError(f"camera: expected the picture's size {width} x {height}, got {given[1]} x {given[0]}")
        return Intrinsics(fx=self.fx, fy=self.fy, cx=self.cx, cy=self.cy, width=width, height=height)


def register(
    rgb_1: Array,
    depth_1: Array,
    rgb_2: Array,
    depth_2: Array,
    camera: Camera,
    *,
    detections: tuple[Found, Found] | None = None,
    detector: Detects | None = None,
    gate: Gate | None = None,
    method: Method | str | None = None,
    params: RegistrationParams | None = None,
) -> Registration:
    """Lay two RGB-D pictures of one camera upon each other by the objects and all else that they show.

    ``rgb (H, W, 3) uint8`` and, registered to it, ``depth (H, W)``: float metres, or uint16 millimetres; 0, NaN and
    infinity are no depth. ``detections`` are the objects of both pictures where they are known; else ``detector`` finds
    them, which is the package's own model for household objects where None. ``method`` is ``"objreg"``, ``"paper"`` or
    one's own, ``gate`` one's own (`objreg_ros.registration.api`); ``params`` are the registrar's.

    ``T_1_2`` of what comes back maps points of camera 2 into camera 1. Where the answer is no, ``accepted`` is False,
    ``T_1_2`` and ``covariance`` are None, and ``reason``, ``detail`` and ``evidence`` say why. ValueError, with
    expected and got, for input of another shape, type or range, and for metres that must be millimetres.
    """
    known_1, known_2 = _two(detections)
    with _named("picture 1"):
        first = segment(rgb_1, depth_1, camera, detections=known_1, detector=detector)
    with _named("picture 2"):
        second = segment(rgb_2, depth_2, camera, detections=known_2, detector=detector)
    return register_keyframes([first], [second], gate=gate, method=method, params=params)


def register_clouds(
    xyz_1: Array,
    rgb_1: Array | None,
    xyz_2: Array,
    rgb_2: Array | None,
    camera: Camera | None = None,
    *,
    detections: tuple[Found, Found] | None = None,
    detector: Detects | None = None,
    gate: Gate | None = None,
    method: Method | str | None = None,
    params: RegistrationParams | None = None,
) -> Registration:
    """As `register`, of two clouds, each in the optical frame of the camera that saw it.

    ``xyz`` float metres, NaN where nothing was measured, and ``rgb`` uint8 of the same shape: (H, W, 3) in the pixels
    of a picture, or (N, 3), which needs a ``camera`` with width and height to be projected with. The camera of a
    picture is fitted to it where None. Boxes and masks are in the pixels of the picture that a cloud gives. ``rgb`` may
    be None where ``detections`` are given. ValueError besides for a cloud that is not before its camera.
    """
    known_1, known_2 = _two(detections)
    with _named("cloud 1"):
        first = _segment_cloud(xyz_1, rgb_1, camera, known_1, detector)
    with _named("cloud 2"):
        second = _segment_cloud(xyz_2, rgb_2, camera, known_2, detector)
    return register_keyframes([first], [second], gate=gate, method=method, params=params)


def register_keyframes(
    frames_1: Sequence[Frame],
    frames_2: Sequence[Frame],
    *,
    gate: Gate | None = None,
    method: Method | str | None = None,
    params: RegistrationParams | None = None,
) -> Registration:
    """As `register`, of two short lists of frames (`segment`), each seen within a short time and fused into a keyframe.

    More than one frame in a list needs ``T_odom_camera`` of each, which must hold within the list: it says nothing
    about the motion between the two. ``T_1_2`` maps points of the camera of the first frame of ``frames_2`` into
    that of the first frame of ``frames_1``. ValueError for an empty list, and for frames without odometry.
    """
    params = params or RegistrationParams()
    if isinstance(method, str):
        params, method = params.replaced(method=method), None
    target, T_1_target = _fused(frames_1, "frames_1", params)
    source, T_2_source = _fused(frames_2, "frames_2", params)
    registration = align(source, target, None, params, method, gate)
    return registration.between(T_1_target, inverse(T_2_source))


def segment(
    rgb: Array | None,
    depth: Array,
    camera: Camera,
    *,
    detections: Found | None = None,
    detector: Detects | None = None,
    T_odom_camera: Array | None = None,
    stamp_ns: int = 0,
) -> Frame:
    """The objects of one RGB-D picture and all else that registration needs of it; inputs as for `register`.

    ``rgb`` may be None where ``detections`` are given. ``T_odom_camera (4, 4)`` is the pose of the camera by odometry,
    where there is one. This is what a `Registrar` takes in. A picture in which nothing is found gives a frame without
    objects; ValueError as `register`.
    """
    metres = _metres(depth)
    intrinsics = camera.intrinsics(*metres.shape)
    if rgb is not None:
        rgb = _colour(rgb, (*metres.shape, 3))
    image = DepthImage(depth=metres, rgb=rgb, intrinsics=intrinsics, stamp_ns=stamp_ns)
    frame = _segment(image, rgb, detections, detector, camera.lens(*metres.shape))
    return frame if T_odom_camera is None else replace(frame, T_odom_camera=np.array(T_odom_camera, np.float64))


def _segment_cloud(
    xyz: Array, rgb: Array | None, camera: Camera | None, known: Found | None, detector: Detects | None
) -> Frame:
    image = _organised(xyz, rgb, camera)
    return _segment(image, image.rgb, known, detector)


def _segment(
    image: DepthImage, rgb: Array | None, known: Found | None, detector: Detects | None, lens: Lens | None = None
) -> Frame:
    """The frame of an image, rectified after detection; ``rgb`` is its colour as it came: a detector may know it."""
    named = known is not None  # then these are the objects, and there are no others
    if known is None:
        if rgb is None:
            raise ValueError("rgb: expected uint8 of shape (H, W, 3) to detect objects in, got None")
        known = (detector or _detect)(rgb)
    detections, masks = (known, None) if isinstance(known, Detections) else _listed(known, image)
    if lens is not None:
        image, detections = lens.rectify(image), lens.rectify_detections(detections)
        masks = masks and [None if mask is None else lens.rectify_mask(mask) for mask in masks]
    segmenter = _segmenter(not named)
    segmenter.forget_stream()  # each call stands for itself
    return segmenter.segment(detections, image, masks=masks)


@cache
def _segmenter(unnamed: bool) -> Segmenter:
    return Segmenter(SegmenterParams(unnamed=unnamed))


@cache
def _model() -> Detector:
    with progress("loading the detector's model"):
        return Detector.of(DetectorParams(), share.model)


def _detect(rgb: Array) -> Detections:
    return _model().detect(ColourImage(rgb=rgb, stamp_ns=0))


def _listed(known: Sequence[tuple[Any, str, float]], image: DepthImage) -> tuple[Detections, list[Array | None]]:
    """The detections of a list, and the mask of each, None where it is a box."""
    boxes: list[Array] = []
    masks: list[Array | None] = []
    for k, item in enumerate(known):
        try:
            where, label, _ = item
        except (TypeError, ValueError):
            raise ValueError(f"detection {k}: expected (box or mask, label, score), got {item!r}"[:200]) from None
        place = np.asarray(where)
        if place.dtype == np.bool_ and place.shape == image.depth.shape:
            masks.append(place)
            boxes.append(_around(place))
        elif place.shape == (4,) and np.issubdtype(place.dtype, np.number):
            masks.append(None)
            boxes.append(place.astype(np.float32))
        else:
            expected = f"a box (4,) or a mask bool of shape {image.depth.shape}"
            raise ValueError(f"detection {k}, {label!r}: expected {expected}, got {place.dtype} of {place.shape}")
    detections = Detections(
        xyxy=np.array(boxes, np.float32).reshape(-1, 4),
        score=np.array([score for _, _, score in known], np.float32),
        label=tuple(str(label) for _, label, _ in known),
        image_hw=image.depth.shape,
        stamp_ns=image.stamp_ns,
    )
    return detections, masks


def _around(mask: Array) -> Array:
    """The box (4,) around a mask; an empty one for an empty mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return np.zeros(4, np.float32)
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], np.float32)


def _metres(depth: Array) -> Array:
    """Depth (H, W) float32 m, 0 where there is none."""
    depth = np.asarray(depth)
    if depth.ndim != 2 or not (depth.dtype == np.uint16 or np.issubdtype(depth.dtype, np.floating)):
        expected = "float metres or uint16 millimetres of shape (H, W)"
        raise ValueError(f"depth: expected {expected}, got {depth.dtype} of shape {depth.shape}")
    if depth.dtype == np.uint16:
        return np.where(depth == NO_DEPTH_MM, 0, depth).astype(np.float32) / np.float32(1000)
    metres = np.where(np.isfinite(depth), depth, 0).astype(np.float32)
    _require_metres("depth", metres, "depth * 0.001, or millimetres as uint16")
    return metres


def _require_metres(name: str, z: Array, remedy: str) -> None:
    """Lengths along the optical axis, 0 and NaN for none, that no camera sees: ValueError that asks for the unit."""
    seen = np.abs(z[np.isfinite(z) & (z != 0)])
    if len(seen) and (middle := float(np.median(seen))) > FAR:
        expected = f"metres, of which a camera sees less than {FAR:g}"
        raise ValueError(f"{name}: expected {expected}, got a median of {middle:g}: millimetres? Then give {remedy}")


def _colour(rgb: Array, shape: tuple[int, ...]) -> Array:
    rgb = np.asarray(rgb)
    if rgb.dtype != np.uint8 or rgb.shape != shape:
        raise ValueError(f"rgb: expected uint8 of shape {shape}, got {rgb.dtype} of shape {rgb.shape}")
    return rgb


def _organised(xyz: Array, rgb: Array | None, camera: Camera | None) -> DepthImage:
    """The picture that a cloud gives."""
    xyz = np.asarray(xyz)
    if xyz.ndim not in (2, 3) or xyz.shape[-1] != 3 or not np.issubdtype(xyz.dtype, np.floating):
        expected = "float metres of shape (H, W, 3) or (N, 3)"
        raise ValueError(f"xyz: expected {expected}, got {xyz.dtype} of shape {xyz.shape}")
    if rgb is not None:
        rgb = _colour(rgb, xyz.shape).reshape(-1, *xyz.shape[-2:])
    intrinsics = None
    if camera is not None:
        size = xyz.shape[:2] if xyz.ndim == 3 else (camera.height, camera.width)
        if min(size) <= 0:
            raise ValueError(f"camera: expected a width and height for points (N, 3), got {size[1]} x {size[0]}")
        intrinsics = camera.intrinsics(*size)
    elif xyz.ndim == 2:
        raise ValueError("camera: expected one with a width and height for points (N, 3), got None")
    points = xyz.astype(np.float32).reshape(-1, *xyz.shape[-2:])
    _require_metres("xyz", points[..., 2], "xyz * 0.001")
    try:
        return organise(PointCloud(xyz=points, rgb=rgb, stamp_ns=0), intrinsics)
    except CloudError as error:
        raise ValueError(f"xyz: {error.fact}; {CLOUD}") from error


def _fused(frames: Sequence[Frame], name: str, params: RegistrationParams) -> tuple[Keyframe, Array]:
    """The keyframe of the frames, and ``T_first_keyframe (4, 4)``: its camera in that of the first of them."""
    if len(frames) == 0:
        raise ValueError(f"{name}: expected at least one frame, got none")
    poses = [frame.T_odom_camera for frame in frames]
    known = [T for T in poses if T is not None]
    if len(frames) > 1 and len(known) < len(frames):
        lacking = f"got {len(frames) - len(known)} of {len(frames)} without"
        raise ValueError(f"{name}: expected T_odom_camera of every frame where there are several, {lacking}")
    motions = tuple(inverse(known[0]) @ T for T in known) if known else (np.eye(4),)
    window = FrameWindow(frames=tuple(map(alone, frames)), T_first_frame=motions, T_session_first=np.eye(4), session=0)
    return fuse(window, params), motions[reference_index(frames)]


def _two(detections: tuple[Found, Found] | None) -> tuple[Found | None, Found | None]:
    if detections is None:
        return None, None
    if isinstance(detections, Detections) or len(detections) != 2:
        got = "one" if isinstance(detections, Detections) else f"{len(detections)}"
        raise ValueError(f"detections: expected those of 1 and those of 2, got {got}")
    return detections


@contextmanager
def _named(what: str) -> Iterator[None]:
    """Say of which of the two an error is."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
