# SPDX-License-Identifier: Apache-2.0
"""Recordings as the benchmarks need them: every frame through detector and segmenter once, with odometry and truth."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from peers import Shot
from stills import stills

from objreg_ros import share
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import ColourImage, DepthImage, Detections
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.geometry import pose, rotation_between
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.segmenter.sensor.depth_to_colour import DepthToColour
from objreg_tools.cli.looks.moments import KeepsFrames, Remembering
from objreg_tools.offline.line import run_offline
from objreg_tools.offline.stages import Stages
from objreg_tools.recording import Recording, open_recording
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.report.run.pictures import Album
from objreg_tools.simulation.odometry import drifted, jittered
from objreg_tools.simulation.params import OdometryParams
from objreg_tools.simulation.truth import read_truth
from objreg_tools.truth import Truth

TRUE_BOXES, NO_BOXES = "truth", "nothing"  # in a model's stead
SIMULATED = {"covariance_calibration": 0.01}  # such a camera is as its calibration says: see config/covariance.yaml
LEAST_VISIBLE = 0.3
Jitter = tuple[float, float]  # by which each pose of odometry errs for itself: degrees, cm
NO_JITTER: Jitter = (0.0, 0.0)


class TrueBoxes:
    """In the detector's stead: the boxes that the truth of a simulated recording knows, distractors left out."""

    def __init__(self, recording: Path) -> None:
        self._frames = {frame.stamp_ns: frame for frame in read_truth(recording).frames}

    def detect(self, image: ColourImage) -> Detections:
        """The objects of which at least `LEAST_VISIBLE` is seen."""
        frame = self._frames.get(image.stamp_ns)
        seen = [
            sight
            for sight in (frame.seen if frame else ())
            if sight.visibility >= LEAST_VISIBLE and not sight.object.is_distractor
        ]
        return Detections(
            xyxy=np.array([sight.xyxy for sight in seen], np.float32).reshape(-1, 4),
            score=np.ones(len(seen), np.float32),
            label=tuple(sight.object.label for sight in seen),
            image_hw=image.rgb.shape[:2],
            stamp_ns=image.stamp_ns,
            frame_id=image.frame_id,
        )


class NoBoxes:
    """In the detector's stead: it sees nothing, so that objects without a name are all there is."""

    def detect(self, image: ColourImage) -> Detections:
        """None."""
        return Detections(
            xyxy=np.zeros((0, 4), np.float32),
            score=np.zeros(0, np.float32),
            label=(),
            image_hw=image.rgb.shape[:2],
            stamp_ns=image.stamp_ns,
            frame_id=image.frame_id,
        )


@dataclass
class Source:
    """A recording with its frames, its truth, its pictures, and the registrar's parameters that its camera asks for."""

    frames: list[Frame]
    truth: Truth
    album: Album
    detections: dict[int, Detections]
    camera: dict[str, float]

    def shot(self, frame: Frame) -> Shot:
        """The whole image of a frame, and its objects by the founding filter."""
        image = self.album.at(frame.stamp_ns)
        if image is None:
            raise ValueError(f"expected colour and depth at {frame.stamp_ns} ns, got none")
        seen = self.detections.get(frame.stamp_ns)
        if seen is None:
            return Shot(image)
        return Shot(
            image, Segmenter(SegmenterParams(preset="paper")).segment(self.album.rectified(seen), image).objects
        )


class Unturned(DepthToColour):
    """Leaves depth beside colour as it comes."""

    def register(self, image: DepthImage, noise: float) -> DepthImage:
        """The image itself."""
        return image


@dataclass(frozen=True)
class Reading:
    """How a recording is read: ``every`` so many-th frame, with its depth brought upon its colour or not."""

    every: int = 1
    registered: bool = True


@contextmanager
def read_source(
    path: Path,
    detector: DetectorParams,
    seed: int,
    drift: float = 1.0,
    jitter: Jitter = NO_JITTER,
    reading: Reading = Reading(),
) -> Iterator[Source]:
    """A recording, open. Without odometry of its own it gets one that drifts from its ground truth, by ``seed``.

    It drifts ``drift`` times 2 % and 1 degree a metre. Either odometry jitters by ``jitter``.
    """
    with open_recording(path) as recording:
        inputs = choose_inputs(recording.topics)
        truth = Truth.of(recording, inputs.ground_truth)
        if not truth.stamps_ns:
            raise ValueError(f"{path}: expected a recording with ground truth, got none")
        frames, seen = _frames(recording, detector, reading)
        if inputs.odom is None:
            frames = with_drift(frames, truth, seed, drift)
        frames = with_jitter(frames, jitter, seed)
        yield Source(frames, truth, Album(recording, inputs), seen, SIMULATED if _is_simulated(path) else {})


def _is_simulated(path: Path) -> bool:
    try:
        read_truth(path)
    except FileNotFoundError:
        return False
    return True


def _frames(recording: Recording, asked: DetectorParams, reading: Reading) -> tuple[list[Frame], dict[int, Detections]]:
    inputs = choose_inputs(recording.topics)
    detector = Remembering(_detector(recording, asked))
    collector, segmenter = KeepsFrames(), Segmenter(SegmenterParams())
    if not reading.registered:
        segmenter.sensor.depth_to_colour = Unturned()
    run_offline(stills(recording, inputs, reading.every), Stages(detector, segmenter, collector), inputs)
    return collector.frames, detector.seen


def _detector(recording: Recording, asked: DetectorParams) -> TrueBoxes | NoBoxes | Detector:
    if asked.model == NO_BOXES:
        return NoBoxes()
    return TrueBoxes(recording.path) if asked.model == TRUE_BOXES else Detector(asked, share.model(asked.model))


def detector_of(model: str = "", threshold: float = 0.5) -> DetectorParams:
    """A detector of a model, the embedded one by default."""
    return DetectorParams(model=model or share.EMBEDDED, threshold=threshold)


def with_drift(frames: list[Frame], truth: Truth, seed: int, drift: float = 1.0) -> list[Frame]:
    """The frames with odometry that drifts ``drift`` times as much as the simulator's, made of their true poses."""
    known = [frame for frame in frames if truth.at(frame.stamp_ns) is not None]
    true = np.array([truth.at(frame.stamp_ns) for frame in known])
    level = np.array([_levelling(known, true) @ T for T in true])
    usual = OdometryParams()
    drifting = usual.replaced(distance_drift=drift * usual.distance_drift, turn_drift=drift * usual.turn_drift)
    poses, _ = drifted(level, drifting, seed)
    return [replace(frame, T_odom_camera=T) for frame, T in zip(known, poses, strict=True)]


def with_jitter(frames: list[Frame], jitter: Jitter, seed: int) -> list[Frame]:
    """The frames with odometry each of whose poses errs for itself, by ``jitter``."""
    degrees, cm = jitter
    posed = [(k, frame.T_odom_camera) for k, frame in enumerate(frames) if frame.T_odom_camera is not None]
    if not posed or jitter == NO_JITTER:
        return frames
    params, found = OdometryParams(turn_jitter=degrees, distance_jitter=cm / 100), list(frames)
    for (k, _), T in zip(posed, jittered(np.array([T for _, T in posed]), params, seed), strict=True):
        found[k] = replace(found[k], T_odom_camera=T)
    return found


def _levelling(frames: list[Frame], true: Array) -> Array:
    """The rotation (4, 4) that puts up, as the frames felt it, along z; upright cameras where none felt it."""
    pairs = list(zip(frames, true, strict=True))
    falls = [T[:3, :3] @ frame.gravity for frame, T in pairs if frame.gravity is not None]
    down = np.median(falls, axis=0) if falls else np.mean([T[:3, 1] for _, T in pairs], axis=0)
    return pose(rotation_between(-down, np.array([0.0, 0.0, 1.0])), np.zeros(3))
