# SPDX-License-Identifier: Apache-2.0
"""Depth in the frame of colour, where boxes are: as it comes where a driver registered it, else registered here.

Two frames are tied by /tf_static, and each picture has its camera_info. Where a driver registered depth, the sizes and
cameras of the two are the same, and often the name of the topic says so.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from objreg_ros import limits
from objreg_ros.bridge.camera import lenses
from objreg_ros.bridge.camera.registered_depth import register
from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers
from objreg_ros.data.checked import Array
from objreg_ros.data.images import ColourImage, DepthImage, Intrinsics, PointCloud
from objreg_ros.geometry import transform

FindPose = Callable[[str, str], Array | None]
"""(a, b) → ``T_a_b (4, 4)``, None where nothing ties the two frames."""

# In the name of a topic.
REGISTERED = re.compile(r"(?<!un)(align|regist)|depth_to_(rgb|colou?r)|rgb_to_depth", re.IGNORECASE)
SAME_FOCAL, SAME_CENTRE_PX = 1e-3, 0.6  # of the focal length; half a pixel lies between two kinds of scaling
SAME_SIDE_PX = 1.0  # to which the sides of a scaled picture are rounded
LEAST_ASIDE_M, LEAST_TURN_DEG = 0.005, 0.5  # by less two frames are one place
OPTICAL = 0.7  # cosine of the most between the axes of two cameras that see the same; a body's frame is 90 deg aside


class Cameras(NamedTuple):
    """The camera_info of depth and, where one is known, that of colour.

    ``named`` is whether the names of the topics say that depth is registered, ``awaited`` whether somebody publishes
    a camera_info of colour, be it here already or not.
    """

    depth: Any
    colour: Any = None
    named: bool = False
    awaited: bool = False


class SeenFrame(NamedTuple):
    """A depth image, the camera_info and lens of the picture that its boxes are in, and what was done to register it.

    ``registered`` is empty where depth is as it came.
    """

    depth: DepthImage
    camera_info: Any
    raw: lenses.Raw
    registered: str = ""


def named_registered(depth_topic: str | None, image_topic: str | None) -> bool:
    """Whether the name of a topic says that depth and colour are registered to each other."""
    return any(REGISTERED.search(topic or "") for topic in (depth_topic, image_topic))


def depth_image(
    depth_message: Any,
    cameras: Cameras,
    colour: Any,
    find_pose: FindPose,
    raw: lenses.Raw = lenses.Raw(),
    most_pixels: int = limits.MOST_PIXELS_OF_PICTURE,
    colour_frame: str = "",
) -> SeenFrame:
    """Depth with colour, registered to it where it did not come so; as `lenses.depth_image`, to the bit, where it did.

    ``colour_frame`` is the frame of the boxes, for where ``colour`` is None. ValueError for a message that breaks its
    contract, and where depth is not registered and nothing says how its camera sits beside that of colour.
    """
    picture = None if colour is None else from_msg.image(colour, most_pixels)
    view = _colour_camera(cameras.colour, picture)
    tie = _Tie(
        _frame(depth_message),
        _frame(picture) or colour_frame.lstrip("/") or _frame(cameras.colour),
        camera_from_msg.intrinsics(cameras.depth),
        view,
        None if picture is None else picture.rgb.shape[:2],
    )
    T_colour_depth = tie.T_colour_depth(find_pose, cameras)
    if T_colour_depth is None or view is None:
        return SeenFrame(
            lenses.depth_image(depth_message, cameras.depth, picture, most_pixels, raw), cameras.depth, raw
        )
    of_colour = lenses.Raw(raw.colour, raw.colour)
    depth = lenses.depth_image(depth_message, cameras.depth, None, most_pixels, lenses.Raw(raw.depth, False))
    lens = lenses.lens_of(cameras.colour, of_colour)
    rgb = None if picture is None else picture.rgb if lens is None else lens.rectify_colour(picture.rgb)
    there = register(depth, T_colour_depth, view if lens is None else lens.camera, rgb, tie.colour)
    return SeenFrame(there, cameras.colour, of_colour, tie.text(T_colour_depth, there.intrinsics))


def in_optical_frame(cloud: PointCloud, colour_frame: str, find_pose: FindPose) -> PointCloud:
    """The cloud in the optical frame of colour where its own is another that /tf_static ties to it, else as it is.

    An organised cloud keeps its rows and columns, so it is turned only out of a frame that is not optical: one of
    another camera has rows and columns of that camera.
    """
    own, colour = cloud.frame_id.lstrip("/"), colour_frame.lstrip("/")
    T_colour_cloud = find_pose(colour, own) if own and colour and own != colour else None
    if T_colour_cloud is None or (cloud.organised and T_colour_cloud[2, 2] >= OPTICAL):
        return cloud
    xyz = transform(T_colour_cloud, cloud.xyz.reshape(-1, 3)).reshape(cloud.xyz.shape)
    return replace(cloud, xyz=xyz.astype(np.float32), frame_id=colour)


class _Tie(NamedTuple):
    """The frames and cameras of depth and colour; ``camera`` and ``size`` are None where colour's are not known."""

    depth: str
    colour: str
    of_depth: Intrinsics
    camera: Intrinsics | None
    size: tuple[int, int] | None  # height and width of the picture of colour

    def T_colour_depth(self, find_pose: FindPose, cameras: Cameras) -> Array | None:
        """How depth is to be moved; None where it counts as registered. ValueError where that cannot be known."""
        one_frame, T = self.depth == self.colour, None
        if self.depth and self.colour:
            T = np.eye(4) if one_frame else find_pose(self.colour, self.depth)
        if self._size == self._depth_size and (one_frame or cameras.named):
            return None
        if cameras.awaited and cameras.colour is None:
            raise ValueError(
                f"depth: expected the camera_info of colour before it, as colour is {self._text()}, got none yet"
            )
        if self._same_view and (not _aside(T) or cameras.named) and self._size == self._depth_size:
            return None
        if self.camera is not None and T is not None and T[2, 2] >= OPTICAL:
            return T
        if self._same_view or (one_frame and self.camera is None):
            return None
        raise ValueError(self._lacking(T))

    @property
    def _depth_size(self) -> tuple[int, int]:
        return self.of_depth.height, self.of_depth.width

    @property
    def _size(self) -> tuple[int, int]:
        """Of colour, that of depth where it is not known."""
        if self.size is not None:
            return self.size
        return self._depth_size if self.camera is None else (self.camera.height, self.camera.width)

    @property
    def _same_view(self) -> bool:
        """Whether colour shows the field of view of depth, by their cameras or else by the shapes of the pictures."""
        across, down = (a / b for a, b in zip(self._size[::-1], self._depth_size[::-1], strict=True))
        if self.camera is None:
            share = min(across, down)
            sides = zip(self._size, self._depth_size, strict=True)
            return all(abs(side / share - other) <= SAME_SIDE_PX for side, other in sides)
        one, other = self.camera, self.of_depth
        focal = one.fx / across / other.fx, one.fy / down / other.fy
        beside = one.cx / across - other.cx, one.cy / down - other.cy
        return bool(np.abs(np.subtract(focal, 1)).max() <= SAME_FOCAL and np.abs(beside).max() <= SAME_CENTRE_PX)

    def _text(self) -> str:
        return (
            f"{self._size[1]} × {self._size[0]} px in {self.colour!r} and depth {self.of_depth.width} × "
            f"{self.of_depth.height} px in {self.depth!r}"
        )

    def _lacking(self, T: Array | None) -> str:
        """What keeps depth from being registered, and what to do."""
        if T is not None and T[2, 2] < OPTICAL:
            lacks, todo = "two optical frames on /tf_static", "name the optical frame in the header of each picture"
        elif T is not None:
            lacks, todo = "the camera_info of colour", "record or publish it too, as colour/camera_info"
        else:
            lacks = "/tf_static between the two frames" + (" and the camera_info of colour" if not self.camera else "")
            todo = "publish both"
        return (
            f"depth: expected depth that is registered to colour, or {lacks}, got colour of {self._text()}; "
            f"{todo}, or record registered depth (align_depth.enable:=true, depth_registered)"
        )

    def text(self, T_colour_depth: Array, camera: Intrinsics) -> str:
        """What was done, for a user."""
        where = " ".join(f"{100 * metres:.1f}" for metres in T_colour_depth[:3, 3])
        return (
            f"depth of {self.depth!r} is registered here to colour of {self.colour!r}, with {where} cm between them, "
            f"as {camera.width} × {camera.height} px"
        )


def _frame(message: Any) -> str:
    """The frame of a message or picture; empty where it has none."""
    return "" if message is None else headers.frame_id(message).lstrip("/")


def _aside(T: Array | None) -> bool:
    """Whether a frame is known to be beside another, and both face the same side."""
    if T is None or T[2, 2] < OPTICAL:
        return False
    turn_deg = np.degrees(np.arccos(np.clip((np.trace(T[:3, :3]) - 1) / 2, -1, 1)))
    return bool(np.linalg.norm(T[:3, 3]) >= LEAST_ASIDE_M or turn_deg >= LEAST_TURN_DEG)


def _colour_camera(camera_info: Any, picture: ColourImage | None) -> Intrinsics | None:
    """The camera of colour; None where it is not calibrated, or of a picture of another size."""
    if camera_info is None:
        return None
    try:
        camera = camera_from_msg.intrinsics(camera_info)
    except ValueError:
        return None
    fits = picture is None or picture.rgb.shape[:2] == (camera.height, camera.width)
    return camera if fits else None
