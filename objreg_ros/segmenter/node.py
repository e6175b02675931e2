# SPDX-License-Identifier: Apache-2.0
"""The node of the segmenter: depth and detections in, objects and views out.

In: ``points``, or ``depth/image`` with ``camera_info`` and ``image``, and ``colour/camera_info`` where depth is not
registered to colour; ``detections_table`` with ``labels``, or ``detections_in``, or ``masks``; ``imu``, or ``odom``
where gravity comes from it. Out: ``objects``, ``detections_3d``, ``view``, ``view/camera_info`` and ``gravity``.
"""

from __future__ import annotations

import sys
from collections import Counter
from functools import partial
from typing import Any

from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from sensor_msgs.msg import Imu as ImuMessage

from objreg_ros.bridge.camera import colour_frame, lenses
from objreg_ros.bridge.camera.calibration import fitted, read_calibration
from objreg_ros.bridge.camera.transforms import receive_frames
from objreg_ros.bridge.messages import from_msg, headers, motion_from_msg, to_msg, vision_to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.overridable import FIXED
from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.bridge.node.spin import run
from objreg_ros.bridge.process.intra_process import IntraProcessBus, Surplus
from objreg_ros.bridge.streams.detections_in import DetectionsIn
from objreg_ros.bridge.streams.matching import view_streams
from objreg_ros.bridge.streams.sync import Drop, Match, Need, Stream
from objreg_ros.bridge.streams.synchronised_node import SynchronisedNode
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import ColourImage, PointCloud
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.pipeline import Host, Pipeline, Segmented
from objreg_ros.segmenter.diagnostics import SegmenterDiagnostics
from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.sensor.doubts import range_doubt, registration_doubt

POINTS = {"points": PointCloud2}
DEPTH = {"depth/image": Image, "depth/image/compressedDepth": CompressedImage}
SOURCES = {"auto": {**POINTS, **DEPTH}, "points": POINTS, "depth": DEPTH}
COLOUR_INFO = "colour/camera_info"
LOOK_S = 0.5  # between two looks for who keeps a camera_info
IMAGES = {"image": Image, "image/compressed": CompressedImage}


class SegmenterNode(SynchronisedNode):
    """Segments every depth image or cloud that has detections; a frame goes out also where there is no object."""

    def __init__(self, bus: IntraProcessBus | None = None) -> None:
        super().__init__("segmenter", SegmenterParams, SegmenterNodeParams, ManagedParams, bus=bus)

    def open(self) -> None:
        """Publish and listen."""
        self._inputs = self.settings.of(SegmenterNodeParams)
        self._segmenter = Segmenter(self.settings.of(SegmenterParams))
        self._camera_info: Any = read_calibration(self._inputs.camera) if self._inputs.camera else None
        self._colour_info: Any = None
        self._detections = DetectionsIn(self, self._inputs.detections)
        self._pipeline = self._made_pipeline()
        self._gravity_from: Counter[str] = Counter()  # frames by the source of their gravity
        self._source: str | None = None  # the topic that depth comes by
        self._lens = self._registered = ""  # the last messages on the lens, and on the registration of depth
        self._objects = self.offer(PointCloud2, "objects", qos.stage())
        self._view = self.create_publisher(PointCloud2, "view", qos.stage())
        self._view_info = self.create_publisher(CameraInfo, "view/camera_info", qos.stage())
        self._gravity = self.create_publisher(Vector3Stamped, "gravity", qos.stage())
        solids = vision_to_msg.Detection3DArray
        self._solids = None if solids is None else self.create_publisher(solids, "detections_3d", qos.stage())
        self._listen()

    def _made_pipeline(self) -> Pipeline:
        host = Host(
            read=self.read,
            timed=self.accounting.timed,
            remind=self.throttled.remind,
            say=self.get_logger().info,
            detections=self._detections.read,
            most_pixels=self.most_pixels,
        )
        return Pipeline(self._segmenter, self._inputs, receive_frames(self), host)

    def _listen(self) -> None:
        self._listen_for_camera()
        if self._inputs.source != "points":
            self._listen_for_colour()
        sources = SOURCES[self._inputs.source]
        self.listen_to_first("depth", sources, self._decode_depth, self._on_depth, self.sensor())
        if self._inputs.level_odom:
            self.listen(Odometry, "odom", self._on_odom, self.sensor(qos.ODOMETRY))
        else:
            self.listen(ImuMessage, "imu", self._on_imu, self.sensor(qos.ODOMETRY))

    def _listen_for_camera(self) -> None:
        """The camera of the parameter where there is one, and no camera_info is awaited."""
        if self._camera_info is not None:
            self.feed("camera_info", 0, self._camera_info)
            return
        self.listen(CameraInfo, "camera_info", self._on_camera, self.sensor(), watched="camera_info")
        self.listen(CameraInfo, COLOUR_INFO, self._receive_colour_camera, self.sensor())
        self._kept = {"camera_info": self._on_camera, COLOUR_INFO: self._receive_colour_camera}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._look = self.create_timer(LOOK_S, self._look_for_kept_camera, clock=steady)

    def _listen_for_colour(self) -> None:
        if self._inputs.colour:
            self.listen_to_first("image", IMAGES, self._decode_image, self._on_image, self.sensor())

    def _look_for_kept_camera(self) -> None:
        """Get what a driver that publishes its cameras once keeps for who comes late, unless they came in time.

        Only where there is such a driver: the others would warn of a QoS that they do not have.
        """
        for topic in [topic for topic in self._kept if self._is_kept(topic)]:
            quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
            options = {"event_callbacks": quiet, "qos_overriding_options": FIXED}  # overrides are of the one above
            self.create_subscription(CameraInfo, topic, self._kept.pop(topic), qos.latched(), **options)
        if self._camera_info is not None or "camera_info" not in self._kept:
            self._look.cancel()

    def _is_kept(self, topic: str) -> bool:
        """Whether a camera that has not come yet is kept by who published it."""
        if (self._camera_info if topic == "camera_info" else self._colour_info) is not None:
            return False
        publishers = self.get_publishers_info_by_topic(self.resolve_topic_name(topic))
        return any(publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for publisher in publishers)

    # Receive

    def _on_camera(self, message: Any) -> None:
        self._camera_info = message
        self.watch.unwatch("camera_info")  # once is enough
        self.feed("camera_info", headers.stamp_ns(message), message)

    def _receive_colour_camera(self, message: Any) -> None:
        self._colour_info = message

    def _on_image(self, _: str, message: Any) -> None:
        surplus = isinstance(message, Surplus)
        self.feed("image", headers.stamp_ns(message), Drop.SURPLUS if surplus else message)

    def _on_odom(self, message: Any) -> None:
        odometry = self.read_aside("odom", motion_from_msg.odometry, message)
        if odometry is not None:
            self.feed("odom", odometry.stamp_ns, odometry)

    def _on_imu(self, message: Any) -> None:
        sample = self.read_aside("imu", motion_from_msg.imu, message)
        felt = None if sample is None else self._pipeline.imu.add_imu(sample)
        if felt is not None:
            self.feed("imu", felt.stamp_ns, felt)

    def _decode_image(self, _: str, message: Any) -> ColourImage:
        return from_msg.image(message, self.most_pixels)

    def _decode_depth(self, topic: str, message: Any) -> Array | PointCloud:
        return from_msg.depth(message, self.most_pixels) if topic in DEPTH else from_msg.point_cloud(message)

    def _on_depth(self, topic: str, message: Any) -> None:
        stamp_ns = headers.stamp_ns(message)
        if self.taken("depth") != topic:
            self._turn_away(stamp_ns, topic, message)
            return
        if topic != self._source:
            self._choose(topic)
        self.feed("depth", stamp_ns, message)

    def _turn_away(self, stamp_ns: int, topic: str, message: Any) -> None:
        """Count a message that does not decode, and so does not say where depth comes from."""
        self.accept(stamp_ns)
        name = "depth" if topic in DEPTH else "points"
        self.conclude(stamp_ns, lambda: self.read(name, self._decode_depth, topic, message) is not None)

    def _choose(self, topic: str) -> None:
        """Depth has spoken, or comes by another topic now: it is known what goes with it."""
        given = self._inputs
        views = view_streams(given.slop, topic in POINTS, given.colour, given.level_odom)
        streams = [*views, Stream("labels", Need.LATCHED)]
        if topic in DEPTH:
            if self._source in POINTS:
                self._listen_for_colour()
            if self._camera_info is None:
                self.expect("camera_info", "camera_info")
        else:
            self.hang_up("image")  # a cloud brings its own colour
            self.watch.unwatch("camera_info")  # and may do without a camera
        self.get_logger().info(f"depth comes from {self.resolve_topic_name(topic)}")
        self._source = topic
        self.start_matching(streams)

    # Compute

    def compute(self, stamp_ns: int, payload: Match) -> bool:
        """One depth image or cloud with its detections, by the parameters as they are now."""
        self._segmenter.params = self.settings.of(SegmenterParams)
        camera_info = self.read("camera_info", fitted, self._camera_of(payload), payload["depth"])
        made = self._pipeline.segment(payload, self._cameras(camera_info), self._raw_pictures())
        names = self._detections.names(payload, made.detections)
        if made.lens:
            self._log_lens(made.lens, made.seen.registered)
        self._gravity_from[made.choice.source] += 1
        self._doubt(made)
        self._publish(made.frame, names)
        return True

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """What matching counts, frames by source of gravity, what of the IMU was not used, and how the sensor errs."""
        apart, sensor = sorted(self._pipeline.apart_deg.copy()), self._segmenter.sensor
        lag = sensor.lag
        own = SegmenterDiagnostics(
            gravity_from=self._gravity_from,
            median_apart_deg=apart[len(apart) // 2] if apart else None,
            imu=self._pipeline.imu.counts,
            noise=sensor.noise,
            turned=sensor.depth_to_colour.text() or None,
            lag=None if lag is None else lag.text(),
        )
        return (*super().own_diagnostics(), own)

    def _doubt(self, made: Segmented) -> None:
        doubts = {
            "registration": registration_doubt(made.detections, made.seen.depth),
            "range": range_doubt(made.seen.depth, made.frame.view, self._segmenter.params),
        }
        for reason, text in doubts.items():
            if text is not None:
                self.throttled.remind(reason, text)

    def _camera_of(self, match: Match) -> Any:
        return match.payloads.get("camera_info", self._camera_info)

    def _topics(self) -> tuple[str, str]:
        """The names of the topics of depth and of colour after all remaps."""
        image = (self.taken("image") if self._inputs.colour and self._source in DEPTH else None) or "image"
        return self.resolve_topic_name(self._source or "depth/image"), self.resolve_topic_name(image)

    def _raw_pictures(self) -> lenses.Raw:
        """The pictures to rectify, by the names of their topics."""
        return lenses.raw_pictures(self._inputs.rectified, *self._topics())

    def _cameras(self, camera_info: Any) -> colour_frame.Cameras:
        named = colour_frame.named_registered(*self._topics())
        awaited = not self._inputs.camera and self._colour_info is None and self.count_publishers(COLOUR_INFO) > 0
        return colour_frame.Cameras(camera_info, self._colour_info, named, awaited)

    def _log_lens(self, lens: str, registered: str) -> None:
        """Say once, and again where it changes, what is assumed of the lens and how depth is registered."""
        if lens != self._lens:
            self._lens = lens
            self.get_logger().info(f"lens: {lens}")
        if registered != self._registered:
            self._registered = registered
            self.get_logger().info(registered or "depth is registered to colour as it comes")

    def _publish(self, frame: Frame, names: to_msg.Labels) -> None:
        self._objects.publish(frame, partial(to_msg.objects, frame, names))
        if self._solids is not None and self._solids.get_subscription_count():
            self._solids.publish(vision_to_msg.objects(frame))
        parts = {self._view: to_msg.view, self._view_info: to_msg.view_camera_info, self._gravity: to_msg.gravity}
        for publisher, write in parts.items():
            if publisher.get_subscription_count():
                publisher.publish(write(frame))


def main() -> int:
    """The executable ``segmenter``."""
    return run(SegmenterNode)


if __name__ == "__main__":
    sys.exit(main())
