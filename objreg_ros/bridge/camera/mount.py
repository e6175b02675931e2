# SPDX-License-Identifier: Apache-2.0
"""Where the camera sits on the body that odometry speaks of."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from enum import Enum
from typing import NamedTuple

from objreg_ros.bridge.camera.chains import body_of
from objreg_ros.bridge.camera.frames import MOST_FRAMES, FrameTie, FrameTree
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Odometry

WHERE = {FrameTie.STATIC: "/tf_static has", FrameTie.CONSTANT: "/tf repeats", FrameTie.MOVING: "/tf moves"}
CAMERAS = re.compile(r"cam(era)?([^a-z]|$)|(^|_)orb(_|$|slam)", re.IGNORECASE)
BODIES = re.compile(r"(^|_)(robot|base\w*|body|local_position)(_|$)", re.IGNORECASE)


class OdometryBody(Enum):
    """Whose pose an odometry without a child_frame_id is."""

    BASE = "base"  # of the robot's base, as the tree of frames has it
    CAMERA = "camera"  # of the camera itself
    UNKNOWN = "unknown"


def nameless_body(topic: str, has_child: bool) -> OdometryBody:
    """Whose pose comes on a topic without a name: of an Odometry (``has_child``) the base's, of a pose what it says."""
    if has_child:
        return OdometryBody.BASE
    for part in reversed(topic.split("/")):
        for body, name in ((OdometryBody.BASE, BODIES), (OdometryBody.CAMERA, CAMERAS)):
            if name.search(part):
                return body
    return OdometryBody.UNKNOWN


class Seat(Enum):
    """What is known of where the camera sits on the body."""

    KNOWN = "known"  # a parameter or the tree of frames says where
    ONE_PLACE = "one place"  # the odometry is the camera's own
    UNKNOWN = "unknown"  # nothing ties the two
    BEYOND = "beyond"  # a joint moves between them, and its position at that time is not known


class Seated(NamedTuple):
    """What is known of the camera on the body, and ``T_body_camera (4, 4)`` where it is `Seat.KNOWN`, else None."""

    seat: Seat
    T_body_camera: Array | None = None


class Mount:
    """The pose of the camera on the body of the odometry.

    ``given`` is the value of a parameter, which wins; without one, ``tree`` is asked. ``say`` receives each assumption,
    and receives it again only where it changes. ``nameless`` is the body of an odometry that names none.
    """

    def __init__(
        self, given: Array | None, tree: FrameTree | None = None, say: Callable[[str], None] = lambda text: None
    ) -> None:
        self._given, self._say = given, say
        self._tree = FrameTree() if tree is None else tree
        self._said: dict[tuple[str, str], str] = {}
        self._asked = ("", "")  # the body and the camera of the last question
        self.nameless = OdometryBody.BASE
        self.unknown = False  # whether the last answer was `Seat.UNKNOWN`

    def T_body_camera(
        self, samples: Sequence[Odometry] | None, camera_frame: str, stamp_ns: int | None = None
    ) -> Array | None:
        """The pose (4, 4) of the camera on the body of these odometry samples; None where the two are one.

        None too where it is not known: `seated` distinguishes the two.
        """
        return self.seated(samples, camera_frame, stamp_ns).T_body_camera

    def seated(self, samples: Sequence[Odometry] | None, camera_frame: str, stamp_ns: int | None = None) -> Seated:
        """What is known of the camera on the body of these odometry samples at a time, by default that of the last.

        `Seat.ONE_PLACE` without any.
        """
        found = self._find(samples, camera_frame.lstrip("/"), stamp_ns)
        self.unknown = found.seat is Seat.UNKNOWN
        return found

    @property
    def reached_ns(self) -> int | None:
        """Until when the joints between body and camera are known; None where none moves, or before a question."""
        return self._tree.reached_ns(*self._asked) if self._given is None else None

    def _find(self, samples: Sequence[Odometry] | None, camera: str, stamp_ns: int | None) -> Seated:
        if self._given is not None:
            return Seated(Seat.KNOWN, self._given)
        if not samples:
            return Seated(Seat.ONE_PLACE)
        odom, body = samples[0].frame_id.lstrip("/"), samples[0].child_frame_id.lstrip("/")
        if not body and camera and self.nameless is OdometryBody.BASE:
            body = body_of(self._tree, odom, camera)
        if body == camera or (not body and self.nameless is OdometryBody.CAMERA):
            return Seated(Seat.ONE_PLACE)
        self._asked = body, camera
        tie = self._tree.tie(body, camera, odom) if body and camera else None
        if tie is None:
            what = f"nothing on /tf_static or /tf ties {_the('odometry', body)} to {_the('camera', camera)}"
            self._announce(
                body, camera, f"{what}: the registrar measures it, others take it to be one place; set T_base_camera"
            )
            return Seated(Seat.UNKNOWN)
        return self._tied(tie, odom, body, camera, samples[-1].stamp_ns if stamp_ns is None else stamp_ns)

    def _tied(self, tie: FrameTie, odom: str, body: str, camera: str, stamp_ns: int) -> Seated:
        T = self._tree.between(body, camera, stamp_ns, odom)
        names = f"{WHERE[tie]} {_the('camera', camera)} on {_the('odometry', body)}"
        if tie is FrameTie.MOVING:
            self._announce(body, camera, f"{names} by a joint, which is followed")
        elif T is not None:
            self._announce(body, camera, f"{names} at {' '.join(f'{metres:.3f}' for metres in T[:3, 3])} m")
        return Seated(Seat.BEYOND) if T is None else Seated(Seat.KNOWN, T)

    def _announce(self, body: str, camera: str, text: str) -> None:
        if text != self._said.get((body, camera)):
            if len(self._said) >= MOST_FRAMES:
                self._said.clear()
            self._said[body, camera] = text
            self._say(text)


def _the(whose: str, frame: str) -> str:
    return f"the {whose}'s {frame!r}"
