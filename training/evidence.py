# SPDX-License-Identifier: Apache-2.0
"""What the gate sees of poses that are known to be right or false: simulated recordings, run offline.

Every keyframe is held against ten others, as `memory/` proposes them, and nothing is left out that the gate is asked
about. What is written of a recording are the readings of each candidate (`gate/kinds.py`), whether a rule refuses it,
and its true error.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from objreg_ros import share
from objreg_ros.data.checked import Array
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_ros.geometry import pose_error
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.kinds import KINDS, readings_of
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.gate.verdict import check_rules, compared, judge
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.propose.evidence import CONSIDERED_MARGIN
from objreg_ros.registration.propose.prior import Prior
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter
from objreg_tools.cli.commands.simulate import camera_of, distortion_of, sensors_of
from objreg_tools.offline.line import run_offline
from objreg_tools.offline.stages import Stages
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.simulation.sensors.camera import SENSORS
from objreg_tools.simulation.write import simulate
from objreg_tools.truth import Truth

SCENARIOS = ("loop", "opposite", "posters", "moved")
RIGS = {
    "plain": (),
    "stress": (),
    "rig": (
        *("rig.lag_ms=20", "rig.rolling_ms=20", "rig.blur_ms=8", "rig.misregistration_px=1.5"),
        f"rig.distortion={distortion_of('webcam')}",
    ),
}
EAGER = {"candidates": 10, "closures": 10, "thin_seconds": 0.2, "threads": 1, "covariance_calibration": 0.01}
FRAMES, RATE = 200, 10.0
THRESHOLD = 0.4  # of detections


@dataclass(frozen=True)
class Plan:
    """A recording that is simulated."""

    scenario: str
    sensor: str
    rig: str
    seed: int

    @property
    def name(self) -> str:
        """As text, as files are called."""
        return f"{self.scenario}_{self.seed}_{self.sensor}_{self.rig}"


@dataclass(frozen=True)
class Rows:
    """What the gate sees of ``N`` candidates.

    ``readings (N, kinds)``, NaN where unknown; ``error (N, 2)`` degrees and cm; ``refused (N,)`` by a rule; ``pair
    (N,)`` of keyframes and ``rank (N,)`` in it, best first; ``sensor (N,)`` by name.
    """

    readings: Array
    error: Array
    refused: Array
    pair: Array
    rank: Array
    sensor: Array

    def __len__(self) -> int:
        return len(self.readings)

    @classmethod
    def joined(cls, parts: Sequence[Rows]) -> Rows:
        """The rows of several recordings; pairs are counted on."""
        first = np.cumsum([0, *(part.pair.max(initial=-1) + 1 for part in parts)])
        pairs = np.concatenate([part.pair + n for part, n in zip(parts, first[:-1], strict=True)])
        fields = {name: np.concatenate([getattr(part, name) for part in parts]) for name in cls.__dataclass_fields__}
        return cls(**{**fields, "pair": pairs})

    def save(self, path: Path) -> None:
        """As a file of numpy."""
        np.savez_compressed(path, **{name: getattr(self, name) for name in self.__dataclass_fields__})

    @classmethod
    def load(cls, path: Path) -> Rows:
        """ValueError for readings of other kinds."""
        with np.load(path) as found:
            rows = cls(**{name: found[name] for name in cls.__dataclass_fields__})
        if rows.readings.shape[1:] != (len(KINDS),):
            raise ValueError(f"{path}: expected {len(KINDS)} readings a row, got {rows.readings.shape}; gather anew")
        return rows


def plans(first_seed: int) -> list[Plan]:
    """Every scenario by every sensor, in every rig, each in a room of its own."""
    chosen = [(scenario, sensor, rig) for rig in RIGS for scenario in SCENARIOS for sensor in SENSORS]
    return [Plan(*one, first_seed + k) for k, one in enumerate(chosen)]


class Recorder:
    """The engine and the gate, with everything that passes between them."""

    def __init__(self, params: RegistrarParams, truth: Truth) -> None:
        self._engine, self._truth = Engine(params), truth
        self._asked: Array | None = None
        self._found: list[tuple[float, ...]] = []
        self._pairs = 0

    def prepare(self, keyframe: Keyframe) -> None:
        """As the engine does."""
        self._engine.prepare(keyframe)

    def propose(
        self, source: Keyframe, target: Keyframe, T_target_source_prior: Array | None = None
    ) -> tuple[Candidate, ...]:
        """As the engine does; the truth is looked up for the gate's answer."""
        self._asked = self._truth.between(target.stamp_ns, source.stamp_ns)
        return self._engine.propose(source, target, T_target_source_prior)

    def judge(self, candidates: Sequence[Candidate], prior: Prior | None = None) -> Candidate | Refusal:
        """As the gate does, and keep what it saw."""
        if candidates and self._asked is not None:
            self._found += rows_of(candidates, prior, self._asked, self._pairs)
            self._pairs += 1
        return judge(candidates, prior)

    def rows(self, sensor: str) -> Rows:
        """What was kept."""
        found = np.array(self._found).reshape(-1, 5 + len(KINDS))
        whole = found[:, 2:5].astype(int)
        return Rows(
            readings=found[:, 5:], error=found[:, :2], refused=whole[:, 0].astype(bool), pair=whole[:, 1],
            rank=whole[:, 2], sensor=np.full(len(found), sensor),
        )  # fmt: skip


def rows_of(
    candidates: Sequence[Candidate], prior: Prior | None, T_true: Array, pair: int
) -> Iterator[tuple[float, ...]]:
    """Of each candidate that the gate may come to: error, refused by a rule, pair, rank, and the readings."""
    least = candidates[0].verification.score - CONSIDERED_MARGIN
    for rank, one in enumerate(compared(candidates)):
        if one.verification.score < least:
            break
        refused = check_rules(one, prior) is not None
        readings = (
            np.nan if reading is None else KINDS[name].scaled(reading) for name, reading in readings_of(one).items()
        )
        yield (*pose_error(one.T_target_source, T_true), refused, pair, rank, *readings)


def gather(plan: Plan) -> Rows:
    """The rows of one recording, which is gone afterwards."""
    cv2.setNumThreads(1)
    camera = camera_of(SENSORS[plan.sensor][0], None)
    sensors = sensors_of(camera, plan.rig == "stress", RIGS[plan.rig], plan.sensor)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording"
        simulate(path, plan.scenario, plan.seed, FRAMES, RATE, sensors=sensors, jpeg=True, threads=1)
        with open_recording(path) as recording:
            inputs = choose_inputs(recording.topics)
            params = RegistrarParams().replaced(**EAGER)
            recorder = Recorder(params, Truth.of(recording, inputs.ground_truth))
            registrar = Registrar(params, method=recorder, gate=recorder.judge)
            detecting = DetectorParams(model=share.EMBEDDED, threshold=THRESHOLD)
            detector = Detector(detecting, share.model(detecting.model))
            stages = Stages(detector, Segmenter(SegmenterParams()), registrar)
            run_offline(recording.records(set(inputs.chosen().values())), stages, inputs)
            registrar.finish()
            registrar.close()
    return recorder.rows(plan.sensor)
