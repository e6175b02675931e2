# SPDX-License-Identifier: Apache-2.0
"""From the messages of one time to a frame: a node drives it live, an offline run from a recording. It knows no ROS.

`bridge/streams/matching.py` says which messages belong together; a `Synchroniser` matches them, and a `Pipeline` makes
a frame of each match. A `CameraStream` gives it its pose by odometry, and the registrar takes it from there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from objreg_ros.bridge.camera import colour_frame, lenses
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.mount import Mount
from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers, motion_from_msg, vision_from_msg
from objreg_ros.bridge.streams.sync import Match
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import FeltGravity, Frame
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.segmenter.gravity.gravity_choice import GravityChoice
from objreg_ros.segmenter.gravity.imu import Imu
from objreg_ros.segmenter.params import SegmenterNodeParams
from objreg_ros.segmenter.sensor.organise import organise
from objreg_ros.segmenter.sensor.sensor_estimate import SensorEstimate

COMPARED = 100  # the last frames over which the difference of IMU and picture is judged
ENOUGH_COMPARED, ODD_DEG = 20, 20.0  # half of this many frames disagree by more: the IMU's mount is wrong

Size = tuple[int, int]
"""Height and width in pixels."""


class Segments(Protocol):
    """The interface of the segmenter."""

    @property
    def choice(self) -> GravityChoice:
        """The source of gravity in the last frame."""
        ...

    @property
    def sensor(self) -> SensorEstimate:
        """What the frames showed of their sensor."""
        ...

    def segment(
        self,
        detections: Detections,
        depth: DepthImage,
        gravity: Array | None = None,
        *,
        gravity_sigma_deg: float | None = None,
    ) -> Frame: ...


@dataclass(frozen=True, slots=True)
class Host:
    """What drives a pipeline: how it reads, measures, warns and states what it assumes.

    ``read(input, decode, *messages)`` is the decoded value, and raises for a message that breaks its contract.
    ``detections(match, size of depth, size of the picture)`` are the boxes of a match in the picture as it came.
    ``remind`` is given a reason and a text, ``say`` a text.
    """

    read: Callable[..., Any]
    timed: Callable[[str], AbstractContextManager[None]]
    remind: Callable[[str, str], object]
    say: Callable[[str], None]
    detections: Callable[[Match, Size, Size], Detections]
    most_pixels: int


class Segmented(NamedTuple):
    """A frame, and what it was made of; ``lens`` is what was assumed of it, empty for a cloud."""

    frame: Frame
    detections: Detections
    seen: colour_frame.SeenFrame
    lens: str
    choice: GravityChoice


class Pipeline:
    """Messages of one time to a frame, with the gravity that an IMU or a level odometry knows."""

    def __init__(self, segmenter: Segments, inputs: SegmenterNodeParams, frames: FrameTree, host: Host) -> None:
        self.imu = Imu(inputs.imu_mounting, frames.between)
        self.mount = Mount(inputs.mounting, frames, host.say)
        self.apart_deg: deque[float] = deque(maxlen=COMPARED)  # IMU and picture, in the last frames that have both
        self.frames = frames
        self._segmenter, self._inputs, self._host = segmenter, inputs, host

    def segment(self, match: Match, cameras: colour_frame.Cameras, raw: lenses.Raw) -> Segmented:
        """The frame of the messages of one time; what ``host.read`` raises where one of them breaks its contract.

        ValueError where a cloud is no surface that a camera sees, or lacks the camera that it needs.
        """
        seen, detections = self._seen(match, cameras, raw)
        gravity, sigma_deg = self._gravity(match, seen.depth.frame_id)
        with self._host.timed("segment"):
            frame = self._segmenter.segment(detections, seen.depth, gravity, gravity_sigma_deg=sigma_deg)
        choice = self._segmenter.choice
        self._compare(choice)
        return Segmented(frame, detections, seen, self._lens(match, seen), choice)

    def _seen(
        self, match: Match, cameras: colour_frame.Cameras, raw: lenses.Raw
    ) -> tuple[colour_frame.SeenFrame, Detections]:
        """Depth and boxes in one picture without a lens."""
        find_pose, picture_frame = self.frames.between, headers.frame_id(match["detections"])
        if "camera_info" in match.payloads:
            messages = match["depth"], cameras, match.payloads.get("image")
            settings = find_pose, raw, self._host.most_pixels, picture_frame
            seen = self._read("depth", colour_frame.depth_image, *messages, *settings)
            return seen, self._boxes(match, seen, seen.camera_info)
        cloud = self._read("points", from_msg.point_cloud, match["depth"])
        cloud = self._read("points", colour_frame.in_optical_frame, cloud, picture_frame, find_pose)
        camera = self._read(
            "camera_info", camera_from_msg.camera_of_cloud, cameras.depth, cloud, self._host.most_pixels
        )
        with self._host.timed("organise"):
            depth = organise(cloud, camera)
        seen = colour_frame.SeenFrame(depth, cameras.depth, raw)
        return seen, self._boxes(match, seen, None, cloud)

    def _lens(self, match: Match, seen: colour_frame.SeenFrame) -> str:
        has_lens = "camera_info" in match.payloads
        return self._read("camera_info", lenses.describe, seen.camera_info, seen.raw) if has_lens else ""

    def _boxes(self, match: Match, seen: colour_frame.SeenFrame, camera_info: Any, cloud: Any = None) -> Detections:
        size = seen.depth.depth.shape
        of_picture = vision_from_msg.picture_hw(match.payloads.get("image"), camera_info) or size
        found = self._host.detections(match, size, of_picture)
        return self._read("camera_info", lenses.detections, found, seen.camera_info, seen.raw, cloud)

    def _read(self, topic: str, decode: Callable[..., Any], *messages: Any) -> Any:
        return self._host.read(topic, decode, *messages)

    def _gravity(self, match: Match, camera_frame: str) -> tuple[Array | None, float | None]:
        """Its direction in the camera frame and the deviation of that; without a deviation it is not weighed."""
        felt = self._felt_gravity(match, camera_frame)
        if felt is not None:
            return felt.gravity, felt.gravity_sigma_deg
        odom = match.payloads.get("odom")
        T_body_camera = self.mount.T_body_camera(odom, camera_frame, match.stamp_ns)
        gravity = motion_from_msg.level_gravity(match.stamp_ns, odom, T_body_camera)
        if gravity is None and self._inputs.level_odom:
            self._host.remind(
                "level_odom", "expected odometry around a frame, as level_odom is on, got none: gravity is estimated; "
                "is odom published 8 times a second at least, stamped by the clock of the camera?"
            )  # fmt: skip
        return gravity, None

    def _felt_gravity(self, match: Match, camera_frame: str) -> FeltGravity | None:
        samples = match.payloads.get("imu")
        if not samples:
            return None
        felt = self.imu.in_camera(motion_from_msg.gravity_at(match.stamp_ns, samples), camera_frame)
        if felt is None:
            self._host.remind(
                "imu_frame", f"expected to know how the IMU is mounted, got it in {samples[0].frame_id!r} and depth in "
                f"{camera_frame!r}: gravity is estimated; set segmenter.T_camera_imu, or publish it on /tf_static"
            )  # fmt: skip
        return felt

    def _compare(self, choice: GravityChoice) -> None:
        """Warn where the gravity of the IMU and that of the picture disagree in most frames."""
        if choice.disagreement_deg is None:
            return
        self.apart_deg.append(choice.disagreement_deg)
        median = float(np.median(self.apart_deg))
        if len(self.apart_deg) >= ENOUGH_COMPARED and median > ODD_DEG:
            self._host.remind(
                "imu_mounting", f"expected the gravity of the IMU and of the picture to agree, got {median:.0f} deg "
                "between them: is segmenter.T_camera_imu right, and does its acceleration at rest point up?"
            )  # fmt: skip
