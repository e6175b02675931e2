# SPDX-License-Identifier: Apache-2.0
"""Draws docs/demo.gif: what the stages find in a simulated room, and how the loops that they close correct the map.

    python -m docs.demo_film [FOLDER]

FOLDER is that of `objreg demo --out FOLDER`, out/demo by default; the room is simulated where it is not there. On the
left is the picture with boxes and object clouds. On the right the room from above: the truth in grey, odometry in
orange, and in blue the trajectory as it is known by then, with the objects where it places them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame, ObjectCloud
from objreg_ros.data.images import ColourImage, DepthImage, Detections, Intrinsics
from objreg_ros.detector.params import DetectorParams
from objreg_ros.geometry import transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.share import EMBEDDED
from objreg_tools.cli.played import simulated_room
from objreg_tools.offline.line import LineParams, run_offline
from objreg_tools.offline.stages import FrameOutcome, Stages, build_stages
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.opening import open_recording
from objreg_tools.report.live_pictures import colour_of, sight
from objreg_tools.report.run.camera_map import CameraMap, TrackedFrame
from objreg_tools.truth import Truth

FILM = Path(__file__).parent / "demo.gif"
EVERY, PICTURE_WH, PLAN_WH = 9, (360, 270), (270, 270)  # one of so many frames; pixels
MS, LAST_MS = 140, 2500  # that a picture is shown, and the last
COLOURS = 64  # of the GIF
POINTS = 60  # of an object that are drawn from above
PAGE, INK, GREY, ORANGE, BLUE, GREEN = (
    (250, 250, 248), (60, 60, 56), (205, 204, 198), (217, 89, 38), (42, 120, 214), (26, 138, 60),
)  # fmt: skip


@dataclass
class Scene:
    """One frame of the recording, as it was seen and placed."""

    rgb: Array
    detections: Detections
    camera: Intrinsics
    objects: Sequence[ObjectCloud]
    stamp_ns: int = 0
    T_odom_camera: Array = field(default_factory=lambda: np.eye(4))
    closures: list[LoopClosure] = field(default_factory=list)  # that this frame brought


class Filmed:
    """The stages, each with what it makes noted: it takes the place of all three."""

    def __init__(self, stages: Stages) -> None:
        self._stages, self.scenes = stages, list[Scene]()
        self._seen: dict[int, tuple[ColourImage, Detections]] = {}
        self.tracked = None

    def __getattr__(self, name: str) -> Any:
        """What the segmenter knows besides: its choice of gravity and its sensor."""
        return getattr(self._stages.segmenter, name)

    def detect(self, image: ColourImage) -> Detections:
        """As the detector."""
        found = self._stages.detector.detect(image)
        self._seen = {image.stamp_ns: (image, found)}
        return found

    def segment(self, detections: Detections, depth: DepthImage, *given: Any, **named: Any) -> Frame:
        """As the segmenter."""
        frame = self._stages.segmenter.segment(detections, depth, *given, **named)
        image, found = self._seen[detections.stamp_ns]
        self.scenes.append(Scene(image.rgb, found, depth.intrinsics, frame.objects))
        return frame

    def process(self, frame: Frame) -> FrameOutcome:
        """As the registrar."""
        outcome, scene = self._stages.registrar.process(frame), self.scenes[-1]
        scene.stamp_ns, scene.closures = frame.stamp_ns, list(outcome.closures)
        if frame.T_odom_camera is not None:
            scene.T_odom_camera = frame.T_odom_camera
        if len(self.scenes) % EVERY != 1:  # of the others the pose alone is drawn
            scene.rgb, scene.objects = np.zeros((1, 1, 3), np.uint8), ()
        return outcome

    def finish(self, doubt: str = "") -> FrameOutcome:
        """As the registrar."""
        return self._stages.registrar.finish(doubt)


def main() -> None:
    """Run the room and write the film."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo")
    with open_recording(simulated_room(folder)) as source:
        inputs = choose_inputs(source.topics, {})
        registrar = RegistrarParams(covariance_calibration=0.01)
        stages, close = build_stages(DetectorParams(model=EMBEDDED), SegmenterParams(), registrar)
        filmed = Filmed(stages)
        records = source.records(set(inputs.chosen().values()))
        run_offline(records, Stages(filmed, filmed, filmed), inputs, LineParams())
        close()
        write_film(FILM, list(pictures(filmed.scenes, Truth.of(source, inputs.ground_truth))))
    print(f"wrote {FILM}, {FILM.stat().st_size / 1e6:.1f} MB")


def write_film(file: Path, frames: Sequence[Array]) -> None:
    """Write pictures (H, W, 3) uint8 RGB as one GIF with the colours of them all."""
    some = np.vstack([frames[k] for k in range(0, len(frames), max(1, len(frames) // 8))])
    palette = Image.fromarray(some).quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    drawn = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    times = [MS] * (len(drawn) - 1) + [LAST_MS]
    drawn[0].save(file, save_all=True, append_images=drawn[1:], duration=times, loop=0, optimize=True)


def pictures(scenes: Sequence[Scene], truth: Truth) -> Iterator[Array]:
    """What is seen and what is known, side by side, at every `EVERY`-th frame and once more at the end."""
    plan = Plan(scenes, truth)
    for k, scene in enumerate(scenes):
        if len(scene.rgb) > 1:
            left = sight(scene.rgb, scene.camera, scene.detections, scene.objects)
            yield np.hstack([cv2.resize(left, PICTURE_WH, interpolation=cv2.INTER_AREA), plan.drawn(k)])


class Plan:
    """The room from above, as it is known after some of the frames."""

    def __init__(self, scenes: Sequence[Scene], truth: Truth) -> None:
        self._scenes = scenes
        true = [T for scene in scenes if (T := truth.at(scene.stamp_ns)) is not None]
        odometry = np.array([scene.T_odom_camera[:3, 3] for scene in scenes])
        first = true[0] @ np.linalg.inv(scenes[0].T_odom_camera)  # the map begins where the camera is
        self._true = transform(np.linalg.inv(first), np.array([T[:3, 3] for T in true]))
        every = np.vstack([self._true, odometry])[:, :2]
        self._middle, extent = (every.min(axis=0) + every.max(axis=0)) / 2, np.ptp(every, axis=0).max()
        self._scale = 0.52 * min(PLAN_WH) / extent

    def drawn(self, last: int) -> Array:
        """(H, W, 3) uint8 RGB after frame ``last``."""
        scenes = self._scenes[: last + 1]
        closures = [closure for scene in scenes for closure in scene.closures]
        frames = [TrackedFrame(scene.stamp_ns, 0, scene.T_odom_camera) for scene in scenes]
        placed = {frame.stamp_ns: frame.T_map_camera for frame in CameraMap.of(frames, closures).frames}
        page = np.full((*PLAN_WH[::-1], 3), PAGE, np.uint8)
        self._objects(page, scenes, placed)
        self._line(page, self._true[: last + 1], GREY, 3)
        self._line(page, np.array([scene.T_odom_camera[:3, 3] for scene in scenes]), ORANGE, 1)
        for closure in closures:
            ends = [placed[stamp][:3, 3] for stamp in (closure.from_ns, closure.to_ns) if stamp in placed]
            if len(ends) == 2:
                self._line(page, np.array(ends), GREEN, 1)
        path = np.array([T[:3, 3] for T in placed.values()])
        self._line(page, path, BLUE, 2)
        cv2.circle(page, tuple(self._at(path[-1:])[0].tolist()), 4, BLUE, cv2.FILLED, cv2.LINE_AA)
        text = f"{(scenes[-1].stamp_ns - scenes[0].stamp_ns) * 1e-9:4.1f} s   {len(closures)} loops closed"
        cv2.putText(page, text, (10, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.45, INK, 1, cv2.LINE_AA)
        return page

    def _objects(self, page: Array, scenes: Sequence[Scene], placed: dict[int, Array]) -> None:
        """The points of objects, where the trajectory as it is known places them."""
        for scene in scenes:
            T = placed.get(scene.stamp_ns)
            for item in scene.objects if T is not None else ():
                xyz = transform(T, item.xyz[:: max(1, len(item.xyz) // POINTS)].astype(float))
                uv = self._at(xyz)
                uv = uv[((uv >= 0) & (uv < PLAN_WH)).all(axis=1)]
                page[uv[:, 1], uv[:, 0]] = colour_of_label(item.label)

    def _line(self, page: Array, xyz: Array, colour: tuple[int, int, int], width: int) -> None:
        cv2.polylines(page, [self._at(xyz)], False, colour, width, cv2.LINE_AA)

    def _at(self, xyz: Array) -> Array:
        """Pixels (N, 2) int32 of points in the map."""
        flat = (np.asarray(xyz)[:, :2] - self._middle) * self._scale * (1.0, -1.0) + np.array(PLAN_WH) / 2
        return np.rint(flat).astype(np.int32)


def colour_of_label(label: str) -> tuple[int, int, int]:
    """The colour of all objects of a label, RGB."""
    return colour_of(sum(map(ord, label)))[::-1]


if __name__ == "__main__":
    main()
