# SPDX-License-Identifier: Apache-2.0
"""The frames of a recording about a few times: those alone go through detector and segmenter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from objreg_ros.bridge.messages import headers
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.keyframes.frame_window import FrameWindow
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import Keyframer
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.cli.recorded import Opened
from objreg_tools.offline.stages import Detects
from objreg_tools.recording.record import Record, Recording

AROUND_NS = 1_500_000_000  # of each time: enough to learn how depth is turned against colour
FIRST = 10  # frames of depth, of which one has its colour
STAMP_FROM = 10**8  # a whole number from here on is a stamp in ns: no recording lasts as many seconds


@dataclass(slots=True)
class Remembering:
    """A detector whose findings stay known, by stamp."""

    detector: Detects
    seen: dict[int, Detections] = field(default_factory=dict)

    def detect(self, image: ColourImage) -> Detections:
        """What the detector finds."""
        self.seen[image.stamp_ns] = self.detector.detect(image)
        return self.seen[image.stamp_ns]


@dataclass(slots=True)
class KeepsFrames:
    """In place of the registrar: keeps the frames."""

    frames: list[Frame] = field(default_factory=list)
    tracked = relocalised = None  # it follows no camera
    whereabouts = ""

    def counts(self) -> dict[str, int]:
        """Nothing is stored."""
        return {}

    def process(self, frame: Frame) -> Outcome:
        """Keep a frame."""
        self.frames.append(frame)
        return Outcome()

    def finish(self, doubt: str = "") -> Outcome:
        """Nothing is left."""
        return Outcome()


def stamp_of(text: str, start_ns: int) -> int:
    """The stamp that a user means: ns, or seconds since ``start_ns``. ValueError for neither."""
    try:
        if text.endswith("ns") or (text.isdecimal() and int(text) >= STAMP_FROM):
            return int(text.removesuffix("ns"))
        return start_ns + round(float(text) * 1e9)
    except (ValueError, OverflowError):
        raise ValueError(f"expected seconds since the beginning as 12.3, or a stamp in ns, got {text!r}") from None


def records_about(opened: Opened, stamps_ns: Sequence[int]) -> Iterator[Record]:
    """The records within `AROUND_NS` of some stamps, in order of time, and before them the cameras."""
    source, inputs = opened.source, opened.inputs
    delay_ns = _delay_ns(source, inputs.depth or inputs.points or "")
    cameras = [topic for topic in (inputs.camera_info, inputs.colour_info) if topic]
    end_ns = source.start_ns
    for at_ns in sorted(stamps_ns):
        begin_ns = max(end_ns, at_ns + delay_ns - AROUND_NS)
        if cameras:
            yield from source.records(cameras, end_ns, begin_ns)
        end_ns = max(begin_ns, at_ns + delay_ns + AROUND_NS)
        yield from source.records(opened.topics, begin_ns, end_ns)


def _delay_ns(source: Recording, topic: str) -> int:
    """How much later than their stamps the messages of a topic were recorded, by the first that decodes."""
    for record in source.records([topic]):
        if (message := record.read()) is not None:
            return record.stamp_ns - headers.stamp_ns(message)
    return 0


def frame_at(frames: Sequence[Frame], stamp_ns: int, start_ns: int) -> Frame:
    """The frame nearest to a stamp. ValueError where none is within `AROUND_NS`."""
    nearest = min(frames, key=lambda frame: abs(frame.stamp_ns - stamp_ns), default=None)
    if nearest is None or abs(nearest.stamp_ns - stamp_ns) > AROUND_NS:
        asked = f"{(stamp_ns - start_ns) * 1e-9:.3f} s after the first ({stamp_ns} ns)"
        raise ValueError(f"expected a frame within {AROUND_NS * 1e-9:g} s of {asked}, got none; choose another time")
    return nearest


def keyframe_of(frame: Frame, frames: Sequence[Frame], params: RegistrarParams, is_fused: bool) -> Keyframe:
    """The keyframe of one frame by itself, or ``is_fused`` the one that a run would make of the ``frames`` about it.

    The latter is the nearest in time; where nothing was detected about it, the frame by itself.
    """
    made = [fuse(window, params) for window in _windows(frames, params)] if is_fused else []
    near = [one for one in made if abs(one.stamp_ns - frame.stamp_ns) <= AROUND_NS]
    nearest = min(near, key=lambda one: abs(one.stamp_ns - frame.stamp_ns), default=None)
    return fuse(FrameWindow.of(frame), params) if nearest is None else nearest


def _windows(frames: Sequence[Frame], params: RegistrarParams) -> Iterator[FrameWindow]:
    keyframer = Keyframer(params)
    for frame in frames:
        if (window := keyframer.add_frame(frame)) is not None:
            yield window
    if (last := keyframer.finish_window()) is not None:
        yield last


def first_stamp_ns(opened: Opened, on_frame: Callable[[int], None] = lambda frames: None) -> int:
    """The stamp of the first frame that gets through, from which a report counts seconds. ValueError for none."""
    run = opened.rehearse(on_frame, frames=FIRST)
    if not run.glimpses:
        raise ValueError(f"{opened.path}: expected a frame of colour and depth at the beginning, got none")
    return int(run.glimpses[0]["stamp_ns"])
