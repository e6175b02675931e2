# SPDX-License-Identifier: Apache-2.0
"""A recording through the stages as the options of a command ask: what `objreg offline` and `objreg batch` share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from objreg_ros.bridge.camera.calibration import absolute
from objreg_ros.detector.params import DetectorParams
from objreg_ros.registrar.params import RegistrarNodeParams, RegistrarParams
from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams
from objreg_tools.cli.settings import Settings, read_settings
from objreg_tools.offline.line import LineParams, run_offline
from objreg_tools.offline.run import Run
from objreg_tools.offline.stages import Detects, Stages, build_stages
from objreg_tools.recording import Record, Recording, open_recording
from objreg_tools.recording.camera_from_text import with_camera
from objreg_tools.recording.drift import ODOM, with_drifting_odometry
from objreg_tools.recording.inputs import TF_ODOM, Inputs, alternatives, choose_inputs, parse_remaps
from objreg_tools.recording.mounts import camera_frame, first_frames, frame_tree, moving_topics
from objreg_tools.recording.recorded_detections import RecordedDetections, choose_detections, recorded_detections
from objreg_tools.recording.tf_odometry import by_transforms, with_transforms
from objreg_tools.recording.troubles import FOLDER, unpaired
from objreg_tools.rehearsal import FRAMES, SeesNothing, rehearse
from objreg_tools.report.run.about import about
from objreg_tools.report.run.camera_map import TRACKED
from objreg_tools.report.run.findings import setting
from objreg_tools.truth import Truth

DRIFT, TF, NONE = "drift:", "tf", "none"
AT_CAMERA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)  # T_base_camera of odometry that is of the camera itself
BY_TRACKING = (
    "there is no odometry: the trajectory is that of the registrar's own tracking (--odometry none: no trajectory)"
)
NOT_ON_TF = (
    "expected a moving frame above the camera on /tf, as odom → base_link, got none; is the camera's frame tied to it?"
)
TAKEN = "of several cameras that of {} is taken; there is also {}: objreg inspect has the --remap of each"
DETECTED = "the recording holds detections of another detector, which are not used: --detections {} takes them"
CAMERAS_OWN = (
    "--odometry {} is the camera's own and not level: T_base_camera and segmenter.level_odom are left out of this run"
)


@dataclass(frozen=True, slots=True)
class RecordedOptions:
    """How recordings are run: the settings of the nodes, the topics, and how far."""

    settings: Settings
    remaps: tuple[str, ...] = ()
    odometry: str | None = None
    max_frames: int | None = None
    detections: str | None = None  # a topic in place of the detector
    seconds: float | None = None  # of the recording from its start; None: all

    @classmethod
    def of(
        cls,
        model: str | None,
        labels: str | None,
        camera: str,
        params_file: Path | None,
        changes: Sequence[str],
        remaps: tuple[str, ...],
        odometry: str | None,
        max_frames: int | None,
        detections: str | None = None,
    ) -> RecordedOptions:
        """The values of the options of `options.of_run`; ValueError for those refused before any recording is read."""
        _require_seed(odometry)
        named = {"detector.model": model, "detector.labels": labels, "segmenter.camera": camera}
        by_option = [f"{name}={value}" for name, value in named.items() if value]
        return cls(read_settings(params_file, [*changes, *by_option]), remaps, odometry, max_frames, detections)

    def until(self, seconds: float | None) -> RecordedOptions:
        """The same of only so many seconds of a recording, of all of it where None."""
        return replace(self, seconds=seconds)

    @property
    def drifts(self) -> bool:
        """Whether odometry is made that drifts from the ground truth."""
        return (self.odometry or "").startswith(DRIFT)

    @contextmanager
    def opened(self, path: Path) -> Iterator[Opened]:
        """A recording with the inputs that it is run on; OSError and ValueError where it has not got them."""
        with open_recording(path) as recording:
            yield replace(self.of_recording(recording), path=path)

    def of_recording(self, recording: Recording) -> Opened:
        """As `opened`, of a recording that is open already, be it one without a file. ValueError as that."""
        segmenter = self.settings.of("segmenter", SegmenterNodeParams)
        camera = with_camera(recording, segmenter.camera, parse_remaps(self.remaps), segmenter.source)
        source = with_transforms(camera, self.odometry == TF)
        inputs = self._inputs(source, segmenter.source)
        recorded = choose_detections(source, self.detections) if self.detections else None
        return Opened(self, recording.path, source, inputs, Truth.of(source, inputs.ground_truth), recorded)

    def _inputs(self, source: Recording, depth_source: str) -> Inputs:
        asked = parse_remaps(self.remaps)
        if self.odometry is not None:
            named = {TF: TF_ODOM, NONE: "", TRACKED: ""}.get(self.odometry, self.odometry)
            asked["odom"] = "" if self.drifts else named
            if asked["odom"] == TF_ODOM and TF_ODOM not in source.topics:
                raise ValueError(f"{source.path}: --odometry tf: {NOT_ON_TF}")
            if asked["odom"] and asked["odom"] not in source.topics:
                expected = f"a topic of {', '.join(source.topics)}, or tf, tracked, none or drift:SEED"
                raise ValueError(f"--odometry: expected {expected}, got {self.odometry!r}")
        inputs = choose_inputs(source.topics, asked, depth_source, first_frames(source))
        if (two := unpaired(source, inputs)) is not None:
            raise ValueError(f"{source.path}: {two.text}")
        if not inputs.complete:
            there = ", ".join(f"{topic.name} ({topic.msgtype})" for topic in source.topics.values()) or "no topics"
            wanted = inputs.wanted(depth_source)
            other = "" if depth_source == "auto" else ", or leave out segmenter.source"
            choose = f"{FOLDER}{other}" if source.of_pictures else f"choose with --remap input:=/topic{other}"
            raise ValueError(f"{source.path}: expected {wanted}, got {there}; {choose}")
        if self.drifts:
            if inputs.ground_truth is None:
                raise ValueError(f"{source.path}: --odometry {self.odometry} needs a ground truth, and there is none")
            return Inputs(**{**inputs.chosen(), "odom": ODOM})
        return inputs


@dataclass(frozen=True, slots=True)
class Opened:
    """A recording that is open, with what is taken of it."""

    asked: RecordedOptions
    path: Path
    source: Recording
    inputs: Inputs
    truth: Truth
    recorded: RecordedDetections | None = None  # in place of the detector

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user on the recording, its truth and the options."""
        registrar = self.asked.settings.of("registrar", RegistrarNodeParams)
        segmenter = self.asked.settings.of("segmenter", SegmenterNodeParams)
        is_given = registrar.mounting is not None or segmenter.level_odom
        left_out = [CAMERAS_OWN.format(self.asked.odometry)] if self.asked.drifts and is_given else []
        by_itself = [BY_TRACKING] if self.odometry == TRACKED and self.asked.odometry is None else []
        of_recording = (*self.source.notes, *self._choice(segmenter.source), *by_transforms(self.source, self.inputs))
        return (*of_recording, *self._detected(), *self.truth.notes, *left_out, *by_itself)

    def _detected(self) -> list[str]:
        """The first detections of the recording, where it has some and they were not asked for."""
        there = [] if self.recorded else recorded_detections(self.source.topics)
        return [DETECTED.format(there[0].topic)] if there else []

    def _choice(self, source: str) -> list[str]:
        """The camera that was taken, where the recording has others that could be meant."""
        remaps = parse_remaps(self.asked.remaps)
        others = alternatives(self.source.topics, first_frames(self.source), remaps, source)
        return [TAKEN.format(self.inputs.image, ", ".join(str(other.image) for other in others))] if others else []

    @property
    def odometry(self) -> str | None:
        """The topic of the odometry; `TRACKED` where there is none, None where no trajectory is asked for."""
        return TRACKED if self.inputs.odom is None and self.asked.odometry != NONE else self.inputs.odom

    @property
    def frames(self) -> int:
        """How many frames will go through at most."""
        count = self.source.topics[self.inputs.depth or self.inputs.points or ""].count
        return min(count, self.asked.max_frames or count)

    def run(
        self,
        registrar: RegistrarParams | None = None,
        on_frame: Callable[[int], None] = lambda n: None,
        detects: Detects | None = None,
    ) -> Run:
        """The result of the stages; ``registrar`` and ``detects`` take the place of those of the settings.

        ``on_frame`` as in `run_offline`.
        """
        settings = self.asked.settings
        detector = settings.of("detector", DetectorParams)
        stages, close = build_stages(
            detector,
            settings.of("segmenter", SegmenterParams),
            registrar or settings.of("registrar", RegistrarParams),
            SeesNothing() if self.recorded else detects,
        )
        of_run = self.inputs, self._params(), self.asked.max_frames, on_frame, self.recorded
        try:
            return run_offline(self._records(), stages, *of_run)
        finally:
            close()

    @property
    def setting(self) -> dict[str, Any]:
        """See `findings.setting`."""
        return setting(self.source, self.inputs, self.asked.settings.of("detector", DetectorParams).model)

    @property
    def topics(self) -> set[str]:
        """The topics that a run reads."""
        return {
            *self.inputs.chosen().values(),
            *moving_topics(self.source),
            *(self.recorded.topics if self.recorded else ()),
        }

    def run_through(self, records: Iterable[Record], stages: Stages, on_frame: Callable[[int], None]) -> Run:
        """The result of other stages on some of the records. ``on_frame`` as in `run_offline`."""
        return run_offline(records, stages, self.inputs, self._params(), None, on_frame, self.recorded)

    def rehearse(self, on_frame: Callable[[int], None], frames: int = FRAMES) -> Run:
        """The run of the first frames without detector and registrar, see `rehearse`; without odometry that drifts."""
        inputs = replace(self.inputs, odom=None) if self.asked.drifts else self.inputs
        return rehearse(self.source, inputs, min(frames, self.frames), on_frame, self._params())

    def summary(self, run: Run, arguments: Sequence[str]) -> dict[str, Any]:
        """The run as JSON, with its settings; ``arguments`` are those of `objreg`."""
        settings, model = self.asked.settings, self.asked.settings.of("detector", DetectorParams).model
        segmenter = settings.of("segmenter", SegmenterNodeParams)
        return {
            "about": about(self.path, model, settings.changed(), arguments),
            "recording": str(self.path.resolve()),
            "inputs": self.inputs.outright,
            "odometry": self.odometry,
            "detections_from": self.recorded.topic if self.recorded else None,
            "store": _resolved(settings.of("registrar", RegistrarParams).store),
            "rectified": segmenter.rectified,
            "camera": absolute(segmenter.camera),
            **self.setting,
            **run.summary(self.truth),
        }

    def _params(self) -> LineParams:
        settings, frames = self.asked.settings, frame_tree(self.source, camera_frame(self.source, self.inputs))
        segmenter = settings.of("segmenter", SegmenterNodeParams)
        registrar = settings.of("registrar", RegistrarNodeParams)
        if self.asked.drifts:
            segmenter = segmenter.replaced(level_odom=False, T_base_camera=())
            registrar = registrar.replaced(T_base_camera=AT_CAMERA)
        return LineParams(segmenter, registrar, frames, settings.of("detector", DetectorParams).max_rate)

    def _records(self) -> Iterator[Record]:
        seconds = self.asked.seconds
        end_ns = None if seconds is None else self.source.start_ns + round(seconds * 1e9)
        records = self.source.records(self.topics, end_ns=end_ns)
        if not self.asked.drifts or self.inputs.ground_truth is None:
            return records
        seed = int(str(self.asked.odometry).removeprefix(DRIFT))
        return with_drifting_odometry(records, self.inputs.ground_truth, seed)


def _require_seed(odometry: str | None) -> None:
    """ValueError for a drift without a seed."""
    is_drift = odometry is not None and (odometry + ":").startswith(DRIFT)
    if is_drift and not str(odometry).removeprefix(DRIFT).isdecimal():
        raise ValueError(f"--odometry: expected drift: and a seed like drift:1, got {odometry!r}")


def _resolved(store: str) -> str:
    return str(Path(store).expanduser().resolve()) if store else ""
