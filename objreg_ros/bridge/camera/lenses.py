# SPDX-License-Identifier: Apache-2.0
"""Pictures of a lens, rectified at the node: what a camera_info says of it, and which pictures are as it made them.

ROS's image_proc gives a rectified picture the camera_info of the raw one, distortion and all. So D alone does not show
whether a picture is rectified. The names of topics do, by convention: image_rect, image_rect_color,
hw_registered/image_rect_raw. A parameter of the segmenter, ``rectified``, overrules them.

A PointCloud2 is never remapped: its points are metres already. One that is organised is taken to share its rows and
columns with the picture of the detector, so boxes stay. One that is not is projected with P, so boxes of a raw picture
are rectified.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from objreg_ros import limits
from objreg_ros.bridge.messages import camera_from_msg, from_msg
from objreg_ros.data.images import DepthImage, Detections, Intrinsics, PointCloud
from objreg_ros.lens import MODELS, UPRIGHT, Lens

RECTIFIED = re.compile(r"(?<![a-z])(un)?rect|Rect|undist")  # in the name of a topic; not in direct
UNTURNED = 1e-6  # of an entry of R
KEPT = 4  # lenses: a driver may change between a few
OTHERWISE = "set segmenter.rectified to all to take the pictures as they are"
NONE_STATED = "none stated: taken as rectified"

Numbers = tuple[float, ...]


class Raw(NamedTuple):
    """Which pictures are as the lens made them."""

    depth: bool = True
    colour: bool = True


def raw_pictures(rectified: str, depth_topic: str | None, image_topic: str | None) -> Raw:
    """What is still to be rectified: by the names of topics where ``rectified`` is auto, nothing by all, both by none.

    The detector's boxes are in the picture of ``image_topic``.
    """
    if rectified == "auto":
        return Raw(*(RECTIFIED.search(topic or "") is None for topic in (depth_topic, image_topic)))
    return Raw(rectified == "none", rectified == "none")


def depth_image(
    depth_message: Any,
    camera_info: Any,
    colour: Any = None,
    most_pixels: int = limits.MOST_PIXELS_OF_PICTURE,
    raw: Raw = Raw(),
) -> DepthImage:
    """As `from_msg.depth_image`, rectified where the camera_info has a lens; unchanged, to the bit, where not."""
    image = from_msg.depth_image(depth_message, camera_info, colour, most_pixels)
    lens = lens_of(camera_info, raw)
    return image if lens is None else lens.rectify(image, *raw)


def detections(found: Detections, camera_info: Any, raw: Raw = Raw(), cloud: PointCloud | None = None) -> Detections:
    """Boxes and masks in the rectified picture; as they came where is no camera_info or lens, or an organised cloud."""
    if camera_info is None or not raw.colour or (cloud is not None and cloud.organised):
        return found
    lens = lens_of(camera_info, raw)
    return found if lens is None else lens.rectify_detections(found)


def describe(camera_info: Any, raw: Raw = Raw(), points: bool = False) -> str:
    """What is assumed of the lens of a camera, for a user; ValueError for a lens that cannot be undone."""
    if not is_distorted(camera_info):
        return NONE_STATED
    if points:
        return f"{_model(camera_info)} stated; points are taken as they come"
    lens = lens_of(camera_info, raw)
    if lens is None:
        return (
            f"{_model(camera_info)} stated, but the pictures are taken as rectified (topic name or segmenter.rectified)"
        )
    what = "rectified" if all(raw) else f"{'depth' if raw.depth else 'colour'} rectified, the other is so already"
    return f"{lens}; {what}"


def is_distorted(camera_info: Any) -> bool:
    """Whether a CameraInfo has a lens: zeros or no coefficients mean that there is none."""
    return bool(np.any(_numbers(camera_info, "d")))


def lens_of(camera_info: Any, raw: Raw = Raw()) -> Lens | None:
    """The lens of a CameraInfo; None where it has none, and where nothing is raw. The newest few are kept.

    The rectified camera is P, turned by R, as ROS has it; it is K where P is zeros, and where R turns the rays of raw
    depth, which then would not stay along the axis. ValueError for a lens that is unknown or cannot be.
    """
    if not any(raw) or not is_distorted(camera_info):
        return None
    D = _numbers(camera_info, "d")
    if len(D) > max(map(max, MODELS.values())):
        raise ValueError(f"camera_info: expected at most 14 coefficients of distortion, got {len(D)}; {OTHERWISE}")
    R = _rotation(camera_info)
    as_stated = R == UPRIGHT or not raw.depth
    bent = camera_from_msg.pinhole(camera_info, "k")
    straight = camera_from_msg.intrinsics(camera_info) if as_stated else bent
    try:
        return _lens(_model(camera_info), tuple(D.tolist()), _key(bent), _key(straight), R if as_stated else UPRIGHT)
    except ValueError as error:
        raise ValueError(f"camera_info: {error}; {OTHERWISE}") from error


@lru_cache(maxsize=KEPT)
def _lens(model: str, D: Numbers, bent: Numbers, straight: Numbers, R: Numbers) -> Lens:
    return Lens(model, D, _camera(bent), _camera(straight), R)


def _key(camera: Intrinsics) -> Numbers:
    return camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height


def _camera(key: Numbers) -> Intrinsics:
    fx, fy, cx, cy, width, height = key
    return Intrinsics(fx=fx, fy=fy, cx=cx, cy=cy, width=int(width), height=int(height))


def _model(camera_info: Any) -> str:
    """The model's name; fisheye is what some drivers call equidistant."""
    name = str(getattr(camera_info, "distortion_model", ""))[:40]
    return "equidistant" if name == "fisheye" else name


def _rotation(camera_info: Any) -> Numbers:
    """R by rows; `UPRIGHT` where it is next to that, or zeros."""
    R = _numbers(camera_info, "r")
    if not R.any() or (R.size == len(UPRIGHT) and np.abs(R - UPRIGHT).max() <= UNTURNED):
        return UPRIGHT
    return tuple(R.tolist())


def _numbers(camera_info: Any, name: str) -> np.ndarray:
    numbers = getattr(camera_info, name, None)
    return np.asarray(getattr(camera_info, name.upper(), ()) if numbers is None else numbers, np.float64).ravel()
