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

from objreg_ros.bridge.camera import colour_frame, lenses
from objreg_ros.bridge.camera.camera_stream import CameraStream
from objreg_ros.bridge.camera.frames import FrameTree
from objreg_ros.bridge.camera.mount import Mount, nameless_body
from objreg_ros.bridge.camera.pace import RateLimit
from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers, motion_from_msg, vision_from_msg
from objreg_ros.bridge.streams.sync import Drop, Match, Need, Stream, Synchroniser
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import FeltGravity, Frame, ObjectCloud
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.segmenter.gravity.gravity_choice import GravityChoice
from objreg_ros.segmenter.gravity.imu import Imu
from objreg_tools.offline.run import Run, glimpse, tracked
from objreg_tools.offline.stages import FrameOutcome, Stages
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import is_moving
from objreg_tools.recording.record import Record
from objreg_tools.recording.recorded_detections import RecordedDetections

Value = TypeVar("Value")

LEFT_OUT = f"depth_{Drop.SURPLUS.value}"
ODOM_DEPTH = 1000  # odometry is small and many times as frequent as frames


@dataclass(frozen=True, slots=True)
class Timing:
    """How the inputs are brought together, as the nodes' parameters say; ``T_base_camera`` as the registrar's.

    With ``level_odom`` the segmenter takes gravity from the odometry, and ``T_level_camera`` is its T_base_camera.
    ``max_rate`` is the detector's; 0, as it is here, is every picture. ``T_camera_imu`` is the segmenter's.
    ``frames`` is asked for each of these that is None, and takes in what /tf says during the run.
    """

    slop_ns: int = 20_000_000
    odom_slop_ns: int = 20_000_000
    T_base_camera: Array | None = None
    colour: bool = True  # whether a depth image takes its colour from `image`
    level_odom: bool = False
    T_level_camera: Array | None = None
    rectified: str = "auto"  # whether pictures come without the distortion of their lens, as the segmenter's parameter
    T_camera_imu: Array | None = None
    frames: FrameTree = field(default_factory=FrameTree)
    max_rate: float = 0.0


class Line:
    """Detector, segmenter and registrar, one after another. Give it messages in order of time, then `finish`.

    With ``recorded`` the detector is not asked: what another one found comes as "detections", and as "label_info" the
    names of its numbers.
    """

    def __init__(
        self, stages: Stages, inputs: Inputs, timing: Timing, max_frames: int | None = None, recorded: bool = False
    ) -> None:
        self.run = Run()
        self._recorded = recorded
        self._names: dict[int, str] = {}  # of the numbers that another detector says
        self._stages, self._timing, self._max_frames = stages, timing, max_frames
        self._from_points = inputs.points is not None
        self._raw = lenses.raw_pictures(timing.rectified, inputs.depth or inputs.points, inputs.image)
        self._camera_info: Any = None
        self._colour_info: Any = None
        self._has_colour_info = inputs.colour_info is not None
        self._named = colour_frame.named_registered(inputs.depth, inputs.image)
        self._rate_limit = RateLimit(timing.max_rate)
        self._imu = Imu(timing.T_camera_imu, timing.frames.between)
        self._mount = Mount(timing.T_base_camera, timing.frames, self._on_of_mount)
        self._stream = CameraStream(self._mount, self._on_of_mount)
        self._level_mount = Mount(timing.T_level_camera, timing.frames)
        self._odom_topic = inputs.odom or ""
        self.run.imu_passed_over = self._imu.counts
        self._labels: dict[int, tuple[str, ...]] = {}  # detected in the frames that are in progress
        self._views = Synchroniser(self._streams(), self._unmatched)
        expected = inputs.odom is not None
        odom = Stream("odom", Need.OPTIONAL, timing.odom_slop_ns, ODOM_DEPTH, enclosing=True, expected=expected)
        joints = Stream("joints", Need.OPTIONAL, timing.odom_slop_ns, ODOM_DEPTH, enclosing=True)
        self._frames = Synchroniser([Stream("frame"), odom, joints], self._unmatched)

    def _streams(self) -> list[Stream]:
        streams = [Stream("depth"), Stream("detections", slop_ns=self._timing.slop_ns)]
        if self._timing.level_odom:
            streams.append(Stream("odom", Need.OPTIONAL, self._timing.slop_ns, ODOM_DEPTH, enclosing=True))
        else:
            streams.append(Stream("imu", Need.OPTIONAL, self._timing.slop_ns, ODOM_DEPTH, enclosing=True))
        if self._from_points:
            return streams
        colour = [Stream("image", Need.OPTIONAL, self._timing.slop_ns)] if self._timing.colour else []
        return [*streams, Stream("camera_info", Need.LATCHED), *colour]

    @property
    def full(self) -> bool:
        """Whether as many frames have gone through as were asked for."""
        return self._max_frames is not None and self.run.frames >= self._max_frames

    def take_record(self, name: str, record: Record) -> None:
        """One recorded message of an input; one that does not decode is counted as dropped."""
        message = self._kept("depth" if name == "points" else name, lambda: record.message)
        if message is not None:
            self.take(name, message)

    def take(self, name: str, message: Any) -> None:
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
            self._camera_info = message
            self._feed(name, stamp_ns, message)
        elif name == "colour_info":
            self._colour_info = message
        elif name in ("depth", "points"):
            self._feed("depth", stamp_ns, message)
        elif name == "odom":
            odometry = self._kept(name, partial(motion_from_msg.odometry, message))
            if odometry is not None:
                body = nameless_body(self._odom_topic, hasattr(message, "child_frame_id"))
                self._mount.nameless = self._level_mount.nameless = body
                self._stream.take_odometry(odometry)
                self._feed(name, stamp_ns, odometry)
                self._track(self._frames.add(name, stamp_ns, odometry))
        elif name == "imu":
            sample = self._kept(name, partial(motion_from_msg.imu, message))
            felt = None if sample is None else self._imu.receive(sample)
            if felt is not None:
                self._feed(name, stamp_ns, felt)

    def _take_tf(self, message: Any) -> None:
        """Take /tf in; frames wait until the joints that carry the camera are known."""
        self._kept("tf", partial(self._timing.frames.receive_moving, message))
        reached_ns = self._mount.reached_ns
        if reached_ns is not None:
            self._track(self._frames.add("joints", reached_ns, None))

    def finish(self) -> Run:
        """Let out what waits."""
        self._segment(self._views.flush())
        self._track(self._frames.flush())
        self._note(self._stages.registrar.finish(self._stream.finish()))
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
            self._segment(self._views.add(name, stamp_ns, payload))

    def _segment(self, matches: Iterable[Match]) -> None:
        for match in matches:
            if match.is_surplus:
                self.run.dropped[LEFT_OUT] += 1
                continue
            made = self._kept("depth", partial(self._frame, match))
            if made is not None:
                frame, detections = made
                self.run.detections += len(detections)
                self.run.objects += len(frame.objects)
                self._labels[frame.stamp_ns] = detections.label
                self._track(self._frames.add("frame", frame.stamp_ns, frame))

    def _frame(self, match: Match) -> tuple[Frame, Detections]:
        with self._timed("decode"):
            depth, detections = self._depth(match)
            odom = match.payloads.get("odom")
            T_body_camera = self._level_mount.T_body_camera(odom, depth.frame_id, match.stamp_ns)
            gravity = motion_from_msg.level_gravity(match.stamp_ns, odom, T_body_camera)
            felt = self._felt_gravity(match, depth.frame_id)
        with self._timed("segment"):
            sigma_deg = None if felt is None else felt.gravity_sigma_deg
            gravity = gravity if felt is None else felt.gravity
            segmenter = self._stages.segmenter
            frame = as_sent(segmenter.segment(detections, depth, gravity, gravity_sigma_deg=sigma_deg))
        self._note_gravity(segmenter.choice)
        return frame, detections

    def _felt_gravity(self, match: Match, camera_frame: str) -> FeltGravity | None:
        samples = match.payloads.get("imu")
        return (
            self._imu.in_camera(motion_from_msg.gravity_at(match.stamp_ns, samples), camera_frame) if samples else None
        )

    def _note_gravity(self, choice: GravityChoice) -> None:
        self.run.gravity_from[choice.source] += 1
        if choice.disagreement_deg is not None:
            self.run.gravity_apart_deg.append(choice.disagreement_deg)

    def _depth(self, match: Match) -> tuple[DepthImage, Detections]:
        """Depth and boxes of one picture without a lens."""
        picture_frame, find_pose = _frame_of(match["detections"]), self._timing.frames.between
        if not self._from_points:
            cameras = colour_frame.Cameras(match["camera_info"], self._colour_info, self._named, self._has_colour_info)
            colour = match.payloads.get("image")
            seen = colour_frame.depth_image(
                match["depth"], cameras, colour, find_pose, self._raw, colour_frame=picture_frame
            )
            self.run.lens = self.run.lens or lenses.describe(seen.camera_info, seen.raw)
            self.run.registered = self.run.registered or seen.registered
            found = self._found(match, seen.depth, seen.camera_info)
            return seen.depth, lenses.detections(found, seen.camera_info, seen.raw)
        cloud = colour_frame.in_optical_frame(from_msg.point_cloud(match["depth"]), picture_frame, find_pose)
        depth = self._stages.organise(cloud, camera_from_msg.camera_of_cloud(self._camera_info, cloud))
        return depth, lenses.detections(self._found(match, depth, None), self._camera_info, self._raw, cloud)

    def _found(self, match: Match, depth: DepthImage, camera_info: Any) -> Detections:
        """The boxes or masks of a match, read now where another detector recorded them."""
        found = match["detections"]
        if isinstance(found, Detections):
            return found
        hw = vision_from_msg.picture_hw(match.payloads.get("image"), camera_info) or depth.depth.shape
        return vision_from_msg.detections(found, self._names, hw)

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
            self.run.dropped[f"malformed_{name}"] += 1
            self.run.complaints.setdefault(f"malformed_{name}", str(error))
            return None

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.run.stage_s[stage].append(time.perf_counter() - start)


def run_offline(
    records: Iterable[Record],
    stages: Stages,
    inputs: Inputs,
    timing: Timing | None = None,
    max_frames: int | None = None,
    on_frame: Callable[[int], None] = lambda frames: None,
    recorded: RecordedDetections | None = None,
) -> Run:
    """Drive the stages with a recording's records, to their end or to ``max_frames``; what came out.

    ``on_frame`` receives how many frames are through, those that were left out among them. ``recorded`` are detections
    that take the place of the detector's.
    """
    line = Line(stages, inputs, timing or Timing(), max_frames, recorded is not None)
    name_of = {topic: name for name, topic in inputs.chosen().items()} | (recorded.topics if recorded else {})
    for record in records:
        name = "tf" if is_moving(record.topic, record.msgtype) else name_of.get(record.topic)
        if name is not None:
            line.take_record(name, record)
            on_frame(line.run.frames + line.run.dropped[LEFT_OUT])
        if line.full:
            break
    return line.finish()


def _frame_of(found: Any) -> str:
    """The frame of detections, which is that of their picture, read or not."""
    return found.frame_id if isinstance(found, Detections) else headers.frame_id(found)


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
