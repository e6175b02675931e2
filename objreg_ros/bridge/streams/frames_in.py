# SPDX-License-Identifier: Apache-2.0
"""How a node receives frames: the segmenter's messages of one stamp, together with odometry."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import String

from objreg_ros.bridge.camera.camera_stream import CameraStream
from objreg_ros.bridge.camera.mount import Mount, OdometryBody, nameless_body
from objreg_ros.bridge.camera.transforms import is_installed, receive_frames
from objreg_ros.bridge.camera.travel import Travel
from objreg_ros.bridge.messages import from_msg, headers, motion_from_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.streams.matching import odometry_streams
from objreg_ros.bridge.streams.sync import Match, Need, Stream
from objreg_ros.bridge.streams.synchronised_node import SynchronisedNode
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.plausibility.finding import Finding

# By which odometry may come. Whose pose one without a child_frame_id is, the name behind all remaps says.
ODOMETRY = {"odom": Odometry, "odom/pose": PoseStamped, "odom/pose_with_covariance": PoseWithCovarianceStamped}

LOOK_S, SILENT_S = 1.0, 5.0  # between two looks at whether frames still come, and without any


class FramesNode(SynchronisedNode):
    """Its counters count the messages of ``objects``; `frame_of` is for `compute`."""

    def prepare(self) -> None:
        """As any node; nothing is known of labels and odometry."""
        super().prepare()
        self._stream = CameraStream(Mount(None))
        self._names = dict[str, dict[int, str]]()  # by robot
        self._seen_s = math.inf  # when the last frame came, by `time.monotonic`
        self.odom_frame = "odom"
        self._camera: str | None = None  # the frame_id of the last frame

    def listen_to_frames(self, given: Array | None, odom_slop: float) -> None:
        """Subscribe. ``given`` is the pose of the camera on the body of odometry; if None, /tf_static and /tf give it.

        Odometry is that of a topic, and that of /tf while no topic of it has a publisher.
        """
        tree = receive_frames(self, then=self._on_tf)
        self._mount = Mount(given, tree, self.get_logger().info)
        self._stream = CameraStream(self._mount, self.get_logger().info)
        self._travel = Travel(tree)
        self._by_topic = False
        topics: dict[str, type] = {"objects": PointCloud2}
        if not self.receives_values:  # which hold these too
            topics |= {"view": PointCloud2, "view/camera_info": CameraInfo, "gravity": Vector3Stamped}
        self.listen(String, "labels", self.receive_labels, qos.latched())
        self._listen_to_odometry()
        for topic, kind in topics.items():
            self.listen(kind, topic, self._receive(topic), qos.stage(), watched=topic)
        self.expect("objects", "objects")
        exact = [Stream(topic) for topic in topics]
        self.start_matching(
            [*exact, Stream("labels", Need.LATCHED), *odometry_streams(odom_slop, joints=is_installed())]
        )

    def _listen_to_odometry(self) -> None:
        for topic, kind in ODOMETRY.items():
            has_child = kind is Odometry
            body = nameless_body(self.resolve_topic_name(topic), has_child)
            self.listen(kind, topic, partial(self._on_odom, body=body), self.sensor(qos.ODOMETRY))

    @property
    def receives_values(self) -> bool:
        """Whether the segmenter is in this process and passes its values in memory."""
        return self.bus.offers(self.resolve_topic_name("objects"))

    def receive_labels(self, message: Any, robot: str = "") -> None:
        """Learn what numbers are called; robots may call one otherwise."""
        names = self.read_aside("labels", from_msg.labels, message)
        if names is not None:
            self._names[robot] = {**self._names.get(robot, {}), **names}
            self.feed("labels", 0, names)

    def names_of(self, robot: str) -> dict[int, str]:
        """What numbers are called by a robot, or by the only one there is."""
        return self._names.get(robot) or self._names.get("", {})

    def _on_odom(self, message: Any, body: OdometryBody = OdometryBody.BASE) -> None:
        odometry = self.read_aside("odom", motion_from_msg.odometry, message)
        if odometry is not None:
            self._by_topic, self._mount.nameless = True, body
            self._stream.take_odometry(odometry)
            self.feed("odom", odometry.stamp_ns, odometry)

    def _on_tf(self, message: Any) -> None:
        """Odometry of /tf, unless it comes by a topic; frames wait for the joints that carry the camera."""
        if not self._by_topic and not any(map(self._is_published, ODOMETRY)):
            for odometry in self._travel.of(message):
                self._stream.take_odometry(odometry)
                self.feed("odom", odometry.stamp_ns, odometry)
        reached_ns = self._mount.reached_ns
        if reached_ns is not None:
            self.feed("joints", reached_ns, True)

    def _is_published(self, topic: str) -> bool:
        return self.count_publishers(self.resolve_topic_name(topic)) > 0

    def _receive(self, topic: str) -> Callable[[Any], None]:
        def receive(message: Any) -> None:
            self._travel.camera = headers.frame_id(message).lstrip("/")
            self.feed(topic, headers.stamp_ns(message), message)

        return receive if topic == "objects" else lambda message: self.feed(topic, headers.stamp_ns(message), message)

    def frame_of(self, match: Match) -> tuple[Frame, Array | None]:
        """A frame, and where the camera sits on the body of its odometry; `DroppedError` if it breaks its contract."""
        odom, camera = match["odom"], headers.frame_id(match["objects"])
        self._watch_camera(camera)
        self.odom_frame = odom[0].frame_id if odom else self.odom_frame
        frame = match["objects"]
        if not isinstance(frame, Frame):
            topics = ("objects", "view", "view/camera_info", "gravity", "labels")
            frame = self.read("frame", from_msg.frame, *(match[topic] for topic in topics))
        self._seen_s = time.monotonic()
        with self.accounting.timed("check"):
            frame = self.read("frame", self._stream.place, frame, odom)
        for finding in self._stream.findings:
            self.throttled.remind(finding.anchor, finding.text)
        return frame, self._stream.T_body_camera

    def when_silent(self, work: Callable[[str], object]) -> None:
        """Do ``work`` aside, once, when no frame came for `SILENT_S`, and again after each next silence.

        It is given the doubt there is of the camera by then, "" for none.
        """

        def look() -> None:
            if time.monotonic() - self._seen_s > SILENT_S:
                self._seen_s = math.inf
                self.aside(lambda: work(self._stream.judge_rest()))

        self.create_timer(LOOK_S, look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def without_odometry(self) -> int:
        """Frames that came, or are used, without odometry."""
        return self._stream.without_odometry

    def found(self) -> Sequence[Finding]:
        """What of the stream is not as it says."""
        return self._stream.findings

    def _watch_camera(self, frame_id: str) -> None:
        """Say so where the frames of two cameras come in turn."""
        if self._camera not in (None, frame_id):
            self.throttled.remind(
                "camera",
                f"expected frames of one camera, got one of {frame_id!r} after one of {self._camera!r}: those that "
                "come late are dropped; give each camera a keyframer, and name it in registrar.robots",
            )
        self._camera = frame_id
