# SPDX-License-Identifier: Apache-2.0
"""One case of `streams`: a recording with a fault, run offline, and what became of it as a row.

A picture is detected in once by each process: what the detector finds hangs on its pixels alone.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from stream_faults import KINDS, RIGHT, Faulty
from stream_grounds import Ground, load
from stream_recording import MemoryRecording

from objreg_ros import share
from objreg_ros.data.checked import Array
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.geometry import pose_error
from objreg_ros.plausibility.finding import Finding
from objreg_tools.cli.recorded import Opened, RecordedOptions
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.mounts import first_frames
from objreg_tools.recording.troubles import troubles
from objreg_tools.report.run.findings import find

LEAST_SHARE = 0.8  # of the constraints of the right recording; fewer are a loss
DRIFT_SEED = 1  # of all recordings but the right ones that are counted for themselves
Row = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """What is run: a kind of fault on a ground, with the seed of its magnitude, with odometry or without.

    ``other`` is the ground whose robot goes another way. ``is_reference`` marks the right recording that others are
    compared with.
    """

    kind: str
    ground: Ground
    other: Ground
    seed: int
    odometry: bool
    frames: int
    is_reference: bool = False

    def faulty(self) -> Faulty:
        """The recording with its fault."""
        loaded = load(self.ground, self.frames)
        is_own_drift = self.kind == RIGHT and not self.is_reference
        right = loaded.recording(self.odometry, self.seed if is_own_drift else DRIFT_SEED)
        rng = np.random.default_rng([self.seed, *self.kind.encode()])
        return KINDS[self.kind].make(right, rng, loaded.aside(load(self.other, self.frames)))


class Remembering:
    """A detector that looks at every picture once."""

    def __init__(self, detector: Detector) -> None:
        self._detector, self._found = detector, dict[bytes, Detections]()

    def detect(self, image: ColourImage) -> Detections:
        """As `Detector.detect`."""
        key = hashlib.blake2b(image.rgb.tobytes(), digest_size=16).digest()
        if key not in self._found:
            self._found[key] = self._detector.detect(image)
        return replace(self._found[key], stamp_ns=image.stamp_ns, frame_id=image.frame_id)


@lru_cache(maxsize=2)
def detector_of(model: str, threshold: float) -> Remembering:
    """The detector of a model, one for a process."""
    return Remembering(Detector.of(DetectorParams(model=model, threshold=threshold, threads=1), share.model))


def asked_of(model: str, threshold: float) -> RecordedOptions:
    """The settings: all of them as they are by default, but for the model and for one thread each."""
    changes = (f"detector.threshold={threshold}", "detector.threads=1", "registrar.threads=1")
    return RecordedOptions.of(model, None, "", None, changes, (), None, None)


def run_case(case: Case) -> Row:
    """What became of a case; ``refused`` says why where it was not run."""
    start, faulty = time.perf_counter(), case.faulty()
    asked = asked_of(case.ground.model, case.ground.threshold)
    row = {
        "kind": case.kind,
        "ground": case.ground.name,
        "seed": case.seed,
        "odometry": case.odometry,
        "is_reference": case.is_reference,
        "magnitude": faulty.magnitude,
    }
    try:
        opened = asked.of_recording(faulty.recording)
        row |= examined(opened, detector_of(case.ground.model, case.ground.threshold), faulty.T_body_camera)
    except (ValueError, OSError) as error:
        named = [finding.anchor for finding in inspected(faulty.recording) if finding.anchor]
        row |= {"refused": str(error), "constraints": 0, "false": 0, "judged": 0, "mount_error": None}
        row["findings"] = named
    return {**row, "seconds": round(time.perf_counter() - start, 2)}


def examined(opened: Opened, detector: Remembering, T_body_camera: Array | None = None) -> Row:
    """Constraints, how many of them are false, and the causes that were found, of a recording that is run."""
    summary = opened.summary(opened.run(detects=detector), ("offline",))
    findings = find(summary, troubles(opened.source, opened.inputs))
    return {
        "frames": summary["frames"],
        "constraints": len(summary["constraints"]),
        "judged": summary["truth"]["count"],
        "false": summary["truth"]["false"],
        "findings": [finding.anchor for finding in findings if finding.anchor],
        "said": [finding.text for finding in findings],
        "rejected": summary["rejected"],
        "dropped": summary["dropped"],
        "mount_error": mount_error(summary.get("mount_estimate"), T_body_camera),
    }


def inspected(recording: MemoryRecording) -> list[Finding]:
    """What `objreg inspect` says of a recording that is not run."""
    return troubles(recording, choose_inputs(recording.topics, frames=first_frames(recording)))


def mount_error(estimate: Any, T_body_camera: Array | None) -> tuple[float, float] | None:
    """(degrees, centimetres) by which an estimated mount is off; None where none was estimated, or truth is unknown."""
    estimated = estimate.get("T_body_camera") if isinstance(estimate, dict) else None
    if estimated is None or T_body_camera is None:
        return None
    return pose_error(np.array(estimated, float).reshape(4, 4), T_body_camera)


def references(cases: Sequence[Case]) -> list[Case]:
    """The right recordings that the cases are compared with, each once."""
    wanted = {(c.ground.name, c.odometry): replace(c, kind=RIGHT, seed=0, is_reference=True) for c in cases}
    return list(wanted.values())


def judged(rows: Sequence[Row]) -> list[Row]:
    """The rows with the constraints of the right recording (``right``), whether the fault loses closures (``loses``)
    and whether its cause is named (``named``). ValueError without the right recording of a row."""
    right = {(row["ground"], row["odometry"]): row["constraints"] for row in rows if row["is_reference"]}
    return [_judged(row, right[row["ground"], row["odometry"]]) for row in rows]


def _judged(row: Row, right: int) -> Row:
    loses = row["false"] > 0 or row["constraints"] < LEAST_SHARE * right
    named = bool(KINDS[row["kind"]].anchors & set(row["findings"]))
    return {**row, "right": right, "loses": loses, "named": named}
