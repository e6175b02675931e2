# SPDX-License-Identifier: Apache-2.0
"""The node of the black box: all inputs in as bytes; a file where something went wrong, or when it is asked for.

A process of its own, beside the others: a robot without it pays nothing.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from objreg_ros.blackbox import events, mcap
from objreg_ros.blackbox.definitions import definition
from objreg_ros.blackbox.diagnostics import BlackboxDiagnostics
from objreg_ros.blackbox.events import Event
from objreg_ros.blackbox.folder import PARAMETERS, Folder
from objreg_ros.blackbox.params import MEGABYTE, BlackboxParams
from objreg_ros.blackbox.recent import Kept, Part, Recent, Source, sources_of, times_of
from objreg_ros.blackbox.stamps import header_stamp_ns
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.diagnostics import accepted_of, refusal_of
from objreg_ros.bridge.node.node_base import NodeBase
from objreg_ros.bridge.node.overridable import FIXED
from objreg_ros.bridge.node.params import ManagedParams
from objreg_ros.bridge.node.spin import run
from objreg_ros.bridge.process.intra_process import IntraProcessBus
from objreg_ros.bridge.process.other_nodes import ParameterReader
from objreg_ros.bridge.streams.clock_monitor import ClockMonitor
from objreg_ros.bridge.streams.player import is_installed, message_type
from objreg_ros.data.localisation import State
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.whole_file import whole_file, write_whole

IMAGE, COMPRESSED, CLOUD = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "PointCloud2"))
CAMERA, TRANSFORMS, TEXT = "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"
STATUS, ODOMETRY = "diagnostic_msgs/msg/DiagnosticArray", "nav_msgs/msg/Odometry"
# What the other nodes receive: topic → type, and what it is of.
INPUTS = {
    "image": (IMAGE, Part.PICTURE),
    "image/compressed": (COMPRESSED, Part.PICTURE),
    "points": (CLOUD, Part.DEPTH),
    "depth/image": (IMAGE, Part.DEPTH),
    "depth/image/compressedDepth": (COMPRESSED, Part.DEPTH),
    "detections_table": (CLOUD, Part.PICTURE),
    "detections_in": ("vision_msgs/msg/Detection2DArray", Part.PICTURE),
    "masks": (IMAGE, Part.PICTURE),
    "camera_info": (CAMERA, Part.MOTION),
    "colour/camera_info": (CAMERA, Part.MOTION),
    "odom": (ODOMETRY, Part.MOTION),
    "odom/pose": ("geometry_msgs/msg/PoseStamped", Part.MOTION),
    "odom/pose_with_covariance": ("geometry_msgs/msg/PoseWithCovarianceStamped", Part.MOTION),
    "imu": ("sensor_msgs/msg/Imu", Part.MOTION),
    "/tf": (TRANSFORMS, Part.MOTION),
    "/tf_static": (TRANSFORMS, Part.MOTION),
    "labels": (TEXT, Part.MOTION),
    "label_info": ("vision_msgs/msg/LabelInfo", Part.MOTION),
}
KEPT = {"/tf_static": 100, "labels": 1, "label_info": 1, "camera_info": 1, "colour/camera_info": 1}  # however old
LEADING = ("image", "image/compressed", "points", "depth/image", "depth/image/compressedDepth")
CAMERAS = ("camera_info", "colour/camera_info")
FAST = ("odom", "odom/pose", "odom/pose_with_covariance", "imu", "/tf")
BETWEEN_NODES = ("detections_table",)  # of our own, which are reliable
# What was decided. `landmarks` has the stamp of each keyframe.
DECISIONS = {
    "refusals": STATUS,
    "acceptances": STATUS,
    "constraints": ODOMETRY,
    "landmarks": CLOUD,
    "finished": "std_msgs/msg/Header",
}
SAID = ("refusals", "acceptances")
STATE = "localisation_state"  # of whatever type its publisher gives it
ASKED = ("detector", "segmenter", "registrar")  # whose parameters are in the file
LOOK_S = 1.0  # between two looks at who publishes what is not always there
OWN = "blackbox"  # the topic of the JSON
FORMAT = 1


class BlackboxNode(NodeBase):
    """Keeps the newest messages, and writes them. Its frames are the files that it was to write.

    ``_keeping`` guards what is kept: the executor's thread adds, the worker and the service take.
    """

    def __init__(self, bus: IntraProcessBus | None = None) -> None:
        super().__init__("blackbox", BlackboxParams, ManagedParams, bus=bus)

    def open(self) -> None:
        """Listen; where ``blackbox_seconds`` is 0 say so, and do nothing."""
        params = self.settings.of(BlackboxParams)
        self._keeping, self._writing = threading.Lock(), threading.Lock()
        self._recent = Recent(params.blackbox_seconds, params.most_kept)
        self._monitor = ClockMonitor[tuple[Source, bytes]](self._keep_odd)
        self._rest = events.Rest(params.blackbox_seconds)
        self._folder = Folder(Path(params.blackbox_folder).expanduser(), round(MEGABYTE * params.blackbox_megabytes))
        self._passed_over, self._last_file, self._state = 0, "", ""
        self._late = {STATE, *CAMERAS}  # what is subscribed to once somebody publishes it so
        self.serve_aside("~/write", self._write_when_called)
        if not params.blackbox_seconds:
            self.get_logger().info("off: blackbox_seconds is 0; nothing is kept")
            return
        self._others = ParameterReader(self, ASKED)
        for topic, (kind, part) in INPUTS.items():
            if is_installed(kind):
                source = Source(self.resolve_topic_name(topic), kind, part, KEPT.get(topic, 0))
                receive = self._keep_leading if topic in LEADING else self._keep
                self._receive_raw(topic, kind, partial(receive, source), self._profile(topic))
        for topic, kind in DECISIONS.items():
            source = Source(self.resolve_topic_name(topic), kind, Part.DECISION)
            self._receive_raw(topic, kind, partial(self._decide, topic, source), qos.stage(depth=1000))
        self.create_timer(LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"keeps the last {params.blackbox_seconds:g} s for {self._folder.path}")

    def _profile(self, topic: str) -> QoSProfile:
        if topic in KEPT and topic not in CAMERAS:
            return qos.latched(KEPT[topic])
        if topic in BETWEEN_NODES:
            return qos.stage()
        return self.sensor(qos.ODOMETRY if topic in FAST else 10)

    def _receive_raw(self, topic: str, kind: str, received: Callable[[bytes], None], profile: QoSProfile) -> None:
        self.create_subscription(message_type(kind), topic, received, profile, raw=True)

    # Receive

    def _keep(self, source: Source, cdr: bytes) -> None:
        stamp_ns = None if source.part is Part.MOTION else header_stamp_ns(cdr)
        with self._keeping:
            self._recent.add(source, cdr, stamp_ns)

    def _keep_leading(self, source: Source, cdr: bytes) -> None:
        """Keep what the camera sends: its stamps are the time of the stream, but for one alone that is far off."""
        stamp_ns = header_stamp_ns(cdr)
        with self._keeping:
            if stamp_ns is None:
                self._recent.add(source, cdr, None)
                return
            for admitted_ns, (source_, cdr_) in self._monitor.admit(stamp_ns, (source, cdr)):
                self._recent.add(source_, cdr_, admitted_ns, leads=True)

    def _keep_odd(self, stamp_ns: int, item: tuple[Source, bytes]) -> None:
        self._recent.add(*item, None)  # it came, and so it is in the file

    def _decide(self, topic: str, source: Source, cdr: bytes) -> None:
        """Keep what was decided, and look whether it makes a file."""
        with self._keeping:
            self._recent.add(source, cdr, header_stamp_ns(cdr))
            if topic == "landmarks" and (stamp_ns := header_stamp_ns(cdr)) is not None:
                self._recent.begin_keyframe(stamp_ns)
        found = self.read_aside(topic, partial(self._event_of, topic), cdr) if topic in SAID else None
        self._act_on(found)

    def _event_of(self, topic: str, cdr: bytes) -> Event | None:
        """The first event in what was decided of a keyframe; None if there is none."""
        params = self.settings.of(BlackboxParams)
        for status in deserialize_message(cdr, DiagnosticArray).status:
            if topic == "refusals":
                no = refusal_of(status)
                event = events.of_refusal(no.reason.value, no.detail, no.from_ns, no.to_ns, params.blackbox_reasons)
            else:
                moments, fields = accepted_of(status)
                event = events.of_closure(*moments, fields["evidence"], params.blackbox_odds)
            if event is not None:
                return event
        return None

    def _on_state(self, source: Source, kind: type, cdr: bytes) -> None:
        with self._keeping:
            self._recent.add(source, cdr, None)
        read = self.read_aside(STATE, lambda data: state_of(deserialize_message(data, kind)), cdr)
        if read is not None:
            before, (self._state, detail) = self._state, read
            self._act_on(events.of_state(self._state, before, detail))

    def _act_on(self, event: Event | None) -> None:
        clock_ns = self._recent.clock_ns
        if event is None or clock_ns is None or not self.is_active:
            return
        if self._rest.passes(clock_ns):
            self.accept(clock_ns)
            self.worker.put((clock_ns, event))
        else:
            self._passed_over += 1

    # What is not always there

    def _look(self) -> None:
        for topic in sorted(self._late):
            full = self.resolve_topic_name(topic)
            offers = self.get_publishers_info_by_topic(full)
            if topic in CAMERAS:
                offers = [one for one in offers if one.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL]
            if offers:
                self._late.discard(topic)
                self._listen_late(topic, full, offers[0].topic_type)

    def _listen_late(self, topic: str, full: str, kind: str) -> None:
        if not is_installed(kind):
            self.get_logger().info(f"{full} is left out: {kind} is not installed")
        elif topic == STATE:
            received = partial(self._on_state, Source(full, kind, Part.DECISION), message_type(kind))
            self._receive_raw(topic, kind, received, qos.stage())
        else:
            source = Source(full, kind, Part.MOTION, KEPT[topic])
            options: dict[str, Any] = {"raw": True, "qos_overriding_options": FIXED}  # overrides are of the first
            self.create_subscription(
                message_type(kind), topic, partial(self._keep_old, source), qos.latched(), **options
            )

    def _keep_old(self, source: Source, cdr: bytes) -> None:
        with self._keeping:
            self._recent.keep(source, cdr)

    # Write

    def compute(self, stamp_ns: int, payload: Event) -> bool:
        """Write the file of an event."""
        self._write(payload)
        return True

    def _write_when_called(self) -> tuple[bool, str]:
        """Whether a file was written, and where it is or why not."""
        clock_ns, answer = self._recent.clock_ns, list[tuple[bool, str]]()
        if clock_ns is None:
            return False, "expected blackbox_seconds over 0 and inputs with stamps, got none yet"
        self.accept(clock_ns)

        def work() -> bool:
            try:
                answer.append((True, str(self._write(Event(events.CALLED)))))
            except (ValueError, OSError) as error:
                answer.append((False, str(error)))
                raise
            return True

        self.conclude(clock_ns, work)
        return answer[0] if answer else (False, "not written, by a bug: see the log")

    def _write(self, event: Event) -> Path:
        """The file of an event. OSError where it cannot be written; nothing of it is left then."""
        values = self._others.read()
        with self._writing:
            with self._keeping:
                messages, begin_ns, end_ns = self._recent.snapshot(), self._recent.begin_ns(), self._recent.clock_ns
            if begin_ns is None or end_ns is None:
                raise ValueError("expected messages, got none")
            about = self._about(event, (begin_ns, end_ns), messages, values)
            text = serialize_message(String(data=json.dumps(about, indent=1)))
            own = Kept(Source(self.resolve_topic_name(OWN), TEXT, Part.DECISION, 1), text, messages[-1].at_ns, None)
            messages = [*messages, own]
            size = sum(len(kept.cdr) + 100 for kept in messages)
            path = self._folder.new_file(end_ns, event.what, size)
            topics, entries = self._entries(messages)
            with whole_file(path) as file:
                mcap.write_mcap(file, topics, entries)
            write_whole(path.with_suffix(PARAMETERS), json.dumps(about["parameters"], indent=1))  # which is YAML
        self._last_file = str(path)
        self.get_logger().warning(f"{event.what}: the last {1e-9 * (end_ns - begin_ns):.1f} s are in {path}")
        return path

    def _entries(self, messages: Sequence[Kept]) -> tuple[list[mcap.Topic], list[tuple[int, int, bytes]]]:
        """The topics of a file, and its messages: number of the topic, time in ns, bytes."""
        sources = sources_of(messages)
        number = {source: k for k, source in enumerate(sources)}
        topics = [
            mcap.Topic(s.topic, s.msgtype, definition(s.msgtype, message_type), s.latched * (s.msgtype != CAMERA))
            for s in sources
        ]
        times = times_of(messages)
        return topics, [(number[kept.source], at, kept.cdr) for kept, at in zip(messages, times, strict=True)]

    def _about(
        self, event: Event, span: tuple[int, int], messages: Sequence[Kept], values: dict[str, dict[str, Any]]
    ) -> dict[str, Any]:
        """What the file says of itself. Stamps in ns."""
        begin_ns, end_ns = span
        moments = {"from_ns": event.from_ns, "to_ns": event.to_ns}
        inside = {name: stamp is not None and begin_ns <= stamp <= end_ns for name, stamp in moments.items()}
        inputs = {topic: self.resolve_topic_name(topic) for topic in (*INPUTS, *DECISIONS)}
        there = {source.topic for source in sources_of(messages)}
        return {
            "format": FORMAT,
            "event": event.what,
            "detail": event.detail,
            **moments,
            "inside": inside,
            "begin_ns": begin_ns,
            "end_ns": end_ns,
            "topics": {topic: full for topic, full in inputs.items() if full in there},
            "versions": self._others.versions(),
            "parameters": {f"/**/{node}": {"ros__parameters": own} for node, own in values.items()},
        }

    def own_diagnostics(self) -> tuple[Diagnostics, ...]:
        """What is kept, and what was written."""
        own = BlackboxDiagnostics(
            kept_messages=len(self._recent),
            kept_bytes=self._recent.nbytes / MEGABYTE,
            kept_seconds=self._recent.span_s,
            jumps=self._recent.jumps,
            passed_over=self._passed_over,
            removed=self._folder.removed,
            last_file=self._last_file or None,
        )
        return (*super().own_diagnostics(), own)


def state_of(message: Any) -> tuple[str, str]:
    """The name of the state that a message states, in its field ``state`` or ``data``, and its ``reason``.

    A number is one of the constants of the message. ValueError for a message without a state.
    """
    state = getattr(message, "state", getattr(message, "data", None))
    if isinstance(state, int):
        state = next((name for name in State.__members__ if getattr(type(message), name, None) == state), None)
    if not isinstance(state, str):
        raise ValueError(f"{STATE}: expected a state, got {type(message).__name__}")
    return state, str(getattr(message, "reason", ""))


def main() -> int:
    """The executable ``blackbox``."""
    return run(BlackboxNode)


if __name__ == "__main__":
    sys.exit(main())
