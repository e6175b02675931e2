# SPDX-License-Identifier: Apache-2.0
"""A recording through detector, segmenter and registrar without ROS: deterministic, as fast as the CPU goes.

The inputs are decoded and brought together by the code that the nodes use, so the same recording gives the same
constraints here and in the live graph, where that loses no frame (a lossless replay).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from objreg_ros import limits
from objreg_ros.bridge.camera import colour_frame, lenses
from objreg_ros.bridge.camera.camera_stream import CameraStream
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.mount import Mount, nameless_body
from objreg_ros.bridge.camera.pace import RateLimit
from objreg_ros.bridge.messages import from_msg, headers, motion_from_msg, vision_from_msg
from objreg_ros.bridge.streams.matching import odometry_streams, view_streams
from objreg_ros.bridge.streams.sync import Drop, Match, Stream, Synchroniser
from objreg_ros.data.frames import Frame, ObjectCloud
from objreg_ros.data.images import Detections
from objreg_ros.params import FramesParams
from objreg_ros.pipeline import Host, Pipeline, Segmented, Size
from objreg_ros.segmenter.params import SegmenterNodeParams
from objreg_tools.offline.run import Run, glimpse, tracked
from objreg_tools.offline.stages import FrameOutcome, Stages
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import is_moving
from objreg_tools.recording.record import Record
from objreg_tools.recording.recorded_detections import RecordedDetections

Value = TypeVar("Value")

LEFT_OUT = f"depth_{Drop.SURPLUS.value}"
ODOM_DEPTH = 1000  # odometry is small and many times as frequent as frames


class _MalformedError(Exception):
    """A message of a match breaks its contract."""

    def __init__(self, topic: str, text: str) -> None:
        super().__init__(text)
        self.topic = topic


@dataclass(frozen=True, slots=True)
class LineParams:
    """The parameters of the nodes that say how their inputs are brought together; ``frames`` takes in what /tf says.

    ``max_rate`` is the detector's; 0, as it is here, is every picture.
    """

    segmenter: SegmenterNodeParams = field(default_factory=SegmenterNodeParams)
    registrar: FramesParams = field(default_factory=FramesParams)
    frames: FrameTree = field(default_factory=FrameTree)
    max_rate: float = 0.0


class Line:
    """Detector, segmenter and registrar, one after another. Give it messages in order of time, then `flush`.

    With ``recorded`` the detector is not asked: what another one found comes as "detections", and as "label_info" the
    names of its numbers.
    """

    def __init__(
        self, stages: Stages, inputs: Inputs, params: LineParams, max_frames: int | None = None, recorded: bool = False
    ) -> None:
        self.run = Run()
        self._recorded = recorded
        self._names: dict[int, str] = {}  # of the numbers that another detector says
        self._stages, self._inputs, self._tree, self._max_frames = stages, inputs, params.frames, max_frames
        self._raw = lenses.raw_pictures(params.segmenter.rectified, inputs.depth or inputs.points, inputs.image)
        self._cameras = colour_frame.Cameras(
            depth=None,
            named=colour_frame.named_registered(inputs.depth, inputs.image),
            awaited=inputs.colour_info is not None,
        )
        self._rate_limit = RateLimit(params.max_rate)
        self._pipeline = Pipeline(stages.segmenter, params.segmenter, params.frames, self._host())
        self._mount = Mount(params.registrar.mounting, params.frames, self._on_of_mount)
        self._stream = CameraStream(self._mount, self._on_of_mount)
        self.run.imu_passed_over = self._pipeline.imu.counts
        self.run.stored_before = stages.registrar.counts()
        self._labels: dict[int, tuple[str, ...]] = {}  # detected in the frames that are in progress
        of_view, slop = params.segmenter, params.registrar.odom_slop
        views = view_streams(of_view.slop, inputs.points is not None, of_view.colour, of_view.level_odom)
        self._views = Synchroniser(views, self._unmatched)
        beside = odometry_streams(slop, expected=inputs.odom is not None)
        self._frames = Synchroniser([Stream("frame"), *beside], self._unmatched)

    def _host(self) -> Host:
        return Host(
            read=self._read,
            timed=self._timed,
            remind=self.run.complaints.setdefault,
            say=lambda text: None,
            detections=self._read_detections,
            most_pixels=limits.MOST_PIXELS_OF_PICTURE,
        )

    @property
    def full(self) -> bool:
        """Whether as many frames have gone through as were asked for."""
        return self._max_frames is not None and self.run.frames >= self._max_frames

    def take_record(self, name: str, record: Record) -> None:
        """One recorded message of an input; one that does not decode is counted as dropped."""
        message = self._kept(name, lambda: record.message)
        if message is not None:
            self.process_message(name, message)

    def process_message(self, name: str, message: Any) -> None:
        """One message of an input of the graph, or of "tf". One that breaks its contract is counted as dropped."""
        if name == "tf":
            self._take_tf(message)
            return
        if name == "label_info":
            names = self._kept(name, partial(vision_from_msg.label_info, message))
            self._names = self._names if names is None else names
            return
        stamp_ns = headers.stamp_ns(message)
        if name == "image" and not self._recorded:
            self._take_image(stamp_ns, message)
        elif name == "image":
            self._feed(name, stamp_ns, message)
        elif name == "detections":
            self._take_detections(stamp_ns, message)
        elif name == "camera_info":
            self._cameras = self._cameras._replace(depth=message)
            self._feed(name, stamp_ns, message)
        elif name == "colour_info":
            self._cameras = self._cameras._replace(colour=message)
        elif name in ("depth", "points"):
            self._feed("depth", stamp_ns, message)
        elif name == "odom":
            odometry = self._kept(name, partial(motion_from_msg.odometry, message))
            if odometry is not None:
                body = nameless_body(self._inputs.odom or "", hasattr(message, "child_frame_id"))
                self._mount.nameless = self._pipeline.mount.nameless = body
                self._stream.take_odometry(odometry)
                self._feed(name, stamp_ns, odometry)
                self._track(self._frames.add_item(name, stamp_ns, odometry))
        elif name == "imu":
            sample = self._kept(name, partial(motion_from_msg.imu, message))
            felt = None if sample is None else self._pipeline.imu.add_imu(sample)
            if felt is not None:
                self._feed(name, stamp_ns, felt)

    def _take_tf(self, message: Any) -> None:
        """Take /tf in; frames wait until the joints that carry the camera are known."""
        self._kept("tf", partial(self._tree.receive_moving, message))
        reached_ns = self._mount.reached_ns
        if reached_ns is not None:
            self._track(self._frames.add_item("joints", reached_ns, None))

    def flush(self) -> Run:
        """Let out what waits."""
        self._segment(self._views.flush())
        self._track(self._frames.flush())
        self._note(self._stages.registrar.finish(self._stream.judge_rest()))
        self.run.note_place(self._stages.registrar.relocalised)
        self.run.whereabouts, self.run.stored_after = (
            self._stages.registrar.whereabouts,
            self._stages.registrar.counts(),
        )
        self.run.findings, self.run.measured_mount = self._stream.findings, self._stream.mount
        sensor = self._stages.segmenter.sensor
        self.run.depth_to_colour = sensor.depth_to_colour.text()
        self.run.depth_noise, self.run.depth_lag = sensor.noise, sensor.lag
        return self.run

    def _take_image(self, stamp_ns: int, message: Any) -> None:
        if not self._rate_limit.admits(stamp_ns):
            self._feed("image", stamp_ns, message)
            self._feed("detections", stamp_ns, Drop.SURPLUS)
            return
        detections = self._kept("image", partial(self._detect, message))
        if detections is not None:
            self._feed("image", stamp_ns, message)
            self._feed("detections", stamp_ns, detections)

    def _take_detections(self, stamp_ns: int, message: Any) -> None:
        if self._kept("detections", partial(vision_from_msg.detections, message, self._names, (1, 1))) is not None:
            self._feed("detections", stamp_ns, message)

    def _detect(self, message: Any) -> Detections:
        with self._timed("decode"):
            image = from_msg.image(message)
        with self._timed("detect"):
            return self._stages.detector.detect(image)

    def _feed(self, name: str, stamp_ns: int, payload: Any) -> None:
        if name in self._views.queues:
            self._segment(self._views.add_item(name, stamp_ns, payload))

    def _segment(self, matches: Iterable[Match]) -> None:
        for match in matches:
            if match.is_surplus:
                self.run.dropped[LEFT_OUT] += 1
                continue
            try:
                made = self._pipeline.segment(match, self._cameras, self._raw)
            except (_MalformedError, ValueError) as error:
                self._drop(f"malformed_{error.topic}" if isinstance(error, _MalformedError) else "refused", str(error))
            else:
                self._pass_on(made)

    def _pass_on(self, made: Segmented) -> None:
        """Note what was segmented; the frame goes on, and waits for its odometry."""
        self.run.note(made)
        frame = as_sent(made.frame)
        self._labels[frame.stamp_ns] = made.detections.label
        self._track(self._frames.add_item("frame", frame.stamp_ns, frame))

    def _read_detections(self, match: Match, size: Size, size_of_picture: Size) -> Detections:
        """The boxes or masks of a match, read now where another detector recorded them."""
        found = match["detections"]
        if isinstance(found, Detections):
            return found
        return self._read("detections", vision_from_msg.detections, found, self._names, size_of_picture)

    def _read(self, topic: str, decode: Callable[..., Value], *messages: Any) -> Value:
        try:
            with self._timed("decode"):
                return decode(*messages)
        except ValueError as error:
            raise _MalformedError(topic, str(error)) from error

    def _track(self, matches: Iterable[Match]) -> None:
        for match in matches:
            if self.full:
                return
            labels = self._labels.pop(match.stamp_ns, ())
            with self._timed("check"):
                frame = self._stream.place(match["frame"], match["odom"])
            self.run.frames += 1
            self.run.glimpses.append(glimpse(frame, labels))
            with self._timed("register"):
                outcome = self._stages.registrar.process(frame)
            if frame.T_odom_camera is None:
                self.run.glimpses[-1]["tracked"] = tracked(self._stages.registrar)
            self._note(outcome)
            self.run.note_place(self._stages.registrar.relocalised)

    def _on_of_mount(self, text: str) -> None:
        self.run.mount = text

    def _note(self, outcome: FrameOutcome) -> None:
        self.run.closures += outcome.closures
        self.run.refusals += outcome.rejected
        self.run.rejected.update(refusal.reason.value for refusal in outcome.rejected)

    def _unmatched(self, name: str, stamp_ns: int, why: str) -> None:
        if name in ("depth", "frame"):
            self.run.dropped[f"{name}_{why}"] += 1

    def _kept(self, name: str, work: Callable[[], Value]) -> Value | None:
        """The result of the work; None, counted as dropped, where a message breaks its contract."""
        try:
            return work()
        except ValueError as error:
            self._drop(f"malformed_{name}", str(error))
            return None

    def _drop(self, reason: str, why: str) -> None:
        self.run.dropped[reason] += 1
        self.run.complaints.setdefault(reason, why)

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.run.stage_s[stage].append(time.perf_counter() - start)


def run_offline(
    records: Iterable[Record],
    stages: Stages,
    inputs: Inputs,
    params: LineParams | None = None,
    max_frames: int | None = None,
    on_frame: Callable[[int], None] = lambda frames: None,
    recorded: RecordedDetections | None = None,
) -> Run:
    """Drive the stages with a recording's records, to their end or to ``max_frames``; what came out.

    ``on_frame`` receives how many frames are through, those that were left out among them. ``recorded`` are detections
    that take the place of the detector's.
    """
    line = Line(stages, inputs, params or LineParams(), max_frames, recorded is not None)
    name_of = {topic: name for name, topic in inputs.chosen().items()} | (recorded.topics if recorded else {})
    for record in records:
        name = "tf" if is_moving(record.topic, record.msgtype) else name_of.get(record.topic)
        if name is not None:
            line.take_record(name, record)
            on_frame(line.run.frames + line.run.dropped[LEFT_OUT])
        if line.full:
            break
    return line.flush()


def as_sent(frame: Frame) -> Frame:
    """The frame with the numbers that survive the wire, where they are float32 and gravity is one vector."""
    falls, confidence = None, 0.0
    if frame.gravity is not None:
        falls, confidence = from_msg.split_gravity(frame.gravity * frame.gravity_confidence)
    return replace(
        frame,
        objects=tuple(_rounded(cloud) for cloud in frame.objects),
        support=None if frame.support is None else _rounded(frame.support),
        gravity=falls,
        gravity_confidence=confidence,
    )


def _rounded(cloud: ObjectCloud) -> ObjectCloud:
    return replace(cloud, score=float(np.float32(cloud.score)), density=float(np.float32(cloud.density)))
