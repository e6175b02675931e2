# SPDX-License-Identifier: Apache-2.0
"""The recordings of the golden results, and what they give today from stored detections."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from objreg_ros.data.closure_fields import fields_of
from objreg_ros.data.closures import Rejected
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_tools.cli.commands.simulate import camera_of, sensors_of
from objreg_tools.offline.line import run_offline
from objreg_tools.offline.run import Run
from objreg_tools.offline.stages import Detects, Stages
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.simulation.write import simulate

FOLDER = Path(__file__).resolve().parent
NO_MODEL_SAW_IT = "expected stored detections of the picture at {} ns, got none; record anew: python {}"
Progress = Callable[[int], object]


class Simulated(NamedTuple):
    """What is simulated; its detections were those of the embedded model."""

    scenario: str
    seed: int
    frames: int
    stress: bool = False
    camera: str = "qvga"


class Real(NamedTuple):
    """How much is taken of a recording in shared/data; its detections were those of the COCO model in shared/models."""

    folder: str
    frames: int


Source = Simulated | Real
SOURCES: dict[str, Source] = {
    "redkitchen_a": Real("redkitchen_a", 128),
    "loop": Simulated("loop", 1, 36),
    "opposite": Simulated("opposite", 121, 36),
    "look-alikes": Simulated("look-alikes", 82, 36),
    "moved": Simulated("moved", 125, 36),
    "stress": Simulated("moved", 128, 36, stress=True),
}


@dataclass(frozen=True)
class Stored:
    """In the detector's stead: what a model saw in each picture, by the picture's stamp."""

    seen: dict[int, Detections]

    def detect(self, image: ColourImage) -> Detections:
        """What was stored of the picture; KeyError where nothing was."""
        if image.stamp_ns not in self.seen:
            raise KeyError(NO_MODEL_SAW_IT.format(image.stamp_ns, FOLDER / "record.py"))
        return self.seen[image.stamp_ns]


def simulated(source: Simulated, folder: Path, progress: Progress = lambda done: None) -> Path:
    """The recording, written into a new folder."""
    sensors = sensors_of(camera_of(source.camera, None), source.stress, ())
    simulate(folder, source.scenario, source.seed, source.frames, sensors=sensors, progress=progress)
    return folder


def run(path: Path, detector: Detects, frames: int, progress: Progress = lambda done: None) -> Run:
    """The first frames of a recording through detector, segmenter and registrar, with default parameters."""
    registrar = Registrar(RegistrarParams())
    try:
        with open_recording(path) as recording:
            inputs = choose_inputs(recording.topics)
            stages = Stages(detector, Segmenter(SegmenterParams()), registrar)
            records = recording.records(set(inputs.chosen().values()))
            return run_offline(records, stages, inputs, max_frames=frames, on_frame=progress)
    finally:
        registrar.close()


def results(run: Run) -> dict[str, Any]:
    """What is held fast of a run, as JSON: every constraint and refusal with all its numbers."""
    outcome = {
        "frames": run.frames,
        "dropped": dict(sorted(run.dropped.items())),
        "constraints": [fields_of(closure) for closure in run.closures],
        "refusals": [refusal(rejected) for rejected in run.refusals],
    }
    return json.loads(json.dumps(outcome))  # as it is read from a file


def refusal(rejected: Rejected) -> dict[str, Any]:
    """A refused candidate as JSON, its pose with all digits."""
    pose = None if rejected.T_from_to is None else rejected.T_from_to.tolist()
    moments = {"from_ns": rejected.from_ns, "to_ns": rejected.to_ns}
    return {"reason": rejected.reason.value, **moments, "T_from_to": pose, "detail": rejected.detail}
