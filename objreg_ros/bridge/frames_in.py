# SPDX-License-Identifier: Apache-2.0
"""How a node hears frames: what the segmenter says of a moment, by the parts that it comes in, with odometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import String

from objreg_ros.bridge import from_msg, qos
from objreg_ros.bridge.matching import MatchingDoor
from objreg_ros.bridge.mount import Mount
from objreg_ros.bridge.sync import Match, Need, Stream
from objreg_ros.data import Array, Frame


class FramesDoor(MatchingDoor):
    """Its books count the messages of ``objects``; `frame_of` is for `compute`."""

    def prepare(self) -> None:
        """As any door; nothing is known of labels and odometry."""
        super().prepare()
        self.without_odometry = 0  # frames
        self._names = dict[str, dict[int, str]]()  # by robot
        self.odom_frame = "odom"
        self._camera: str | None = None  # the frame_id of the last frame

    def listen_to_frames(self, mount: Mount, odom_slop_ns: int) -> None:
        """Subscribe; ``mount`` says where the camera sits on the body of odometry."""
        self._mount = mount
        room: dict[str, type] = {"objects": PointCloud2}
        if not self.hears_words:  # which hold these too
            room |= {"view": PointCloud2, "view/camera_info": CameraInfo, "gravity": Vector3Stamped}
        self.listen(String, "labels", self.hear_labels, qos.latched())
        self.listen(Odometry, "odom", self._hear_odom, self.sensor(qos.ODOMETRY))
        for topic, kind in room.items():
            self.listen(kind, topic, self._hear(topic), qos.room(), watched=topic)
        self.expect("objects", "objects")
        exact = [Stream(topic) for topic in room]
        odom = Stream("odom", Need.OPTIONAL, odom_slop_ns, depth=1000, enclosing=True)
        self.begin([*exact, Stream("labels", Need.LATCHED), odom])

    @property
    def hears_words(self) -> bool:
        """Whether the segmenter is in this process and hands its words over."""
        return self.indoors.offers(self.resolve_topic_name("objects"))

    def hear_labels(self, message: Any, robot: str = "") -> None:
        """Learn what numbers are called; robots may call one otherwise."""
        names = self.read_aside("labels", from_msg.labels, message)
        if names is not None:
            self._names[robot] = {**self._names.get(robot, {}), **names}
            self.feed("labels", 0, names)

    def names_of(self, robot: str) -> dict[int, str]:
        """What numbers are called by a robot, or by the only one there is."""
        return self._names.get(robot) or self._names.get("", {})

    def _hear_odom(self, message: Any) -> None:
        odometry = self.read_aside("odom", from_msg.odometry, message)
        if odometry is not None:
            self.feed("odom", odometry.stamp_ns, odometry)

    def _hear(self, topic: str) -> Callable[[Any], None]:
        return lambda message: self.feed(topic, from_msg.stamp_ns(message), message)

    def frame_of(self, match: Match) -> tuple[Frame, Array | None]:
        """A frame, and where the camera sits on the body of its odometry; `DroppedError` if it breaks its contract."""
        odom, camera = match["odom"], from_msg.frame_id(match["objects"])
        self._watch_camera(camera)
        self.without_odometry += odom is None
        self.odom_frame = odom[0].frame_id if odom else self.odom_frame
        T_body_camera = self._mount.T_body_camera(odom, camera)
        if isinstance(match["objects"], Frame):
            return self.read("frame", from_msg.followed, match["objects"], odom, T_body_camera), T_body_camera
        topics = ("objects", "view", "view/camera_info", "gravity", "labels", "odom")
        return self.read("frame", from_msg.frame, *(match[topic] for topic in topics), T_body_camera), T_body_camera

    def _watch_camera(self, frame_id: str) -> None:
        """Say so where the frames of two cameras come in turn."""
        if self._camera not in (None, frame_id):
            self.throttled.remind(
                "camera",
                f"expected frames of one camera, got one of {frame_id!r} after one of {self._camera!r}: those that "
                "come late are dropped; give each camera a keyframer, and name it in registrar.robots",
            )
        self._camera = frame_id
