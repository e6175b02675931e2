# SPDX-License-Identifier: Apache-2.0
"""Detector, segmenter and registrar as a recording needs them: what each must be able to do, and how they are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Rejected, Relocalised
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.detector.params import DetectorParams
from objreg_ros.pipeline import Segments
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.segmenter.params import SegmenterParams


class Detects(Protocol):
    """The interface of the detector."""

    def detect(self, image: ColourImage) -> Detections: ...


class FrameOutcome(Protocol):
    """The registrar's result for a frame."""

    @property
    def closures(self) -> tuple[LoopClosure, ...]: ...

    @property
    def rejected(self) -> tuple[Rejected, ...]: ...


class Registers(Protocol):
    """The interface of the registrar."""

    @property
    def tracked(self) -> tuple[int, Array] | None:
        """The session of the newest frame and where the camera is in it, if that was followed."""
        ...

    @property
    def relocalised(self) -> Relocalised | None:
        """Where the newest frame is in the map of an earlier session."""
        ...

    @property
    def whereabouts(self) -> str:
        """By what that is known, or why it is not."""
        ...

    def counts(self) -> dict[str, int]:
        """How much the store holds."""
        ...

    def process(self, frame: Frame) -> FrameOutcome: ...

    def finish(self, doubt: str = "") -> FrameOutcome: ...


@dataclass(frozen=True, slots=True)
class Stages:
    """Detector, segmenter and registrar."""

    detector: Detects
    segmenter: Segments
    registrar: Registers


def build_stages(
    detector: DetectorParams, segmenter: SegmenterParams, registrar: RegistrarParams, detects: Detects | None = None
) -> tuple[Stages, Callable[[], None]]:
    """The stages by their parameters, and what closes them. OSError and ValueError as the stages raise them.

    ``detects`` takes the place of the detector: what remembers pictures that it has seen before, say.
    """

    from objreg_ros import share
    from objreg_ros.detector.detector import Detector
    from objreg_ros.registrar.registrar import Registrar
    from objreg_ros.segmenter.segment import Segmenter

    detects = detects or Detector.of(detector, share.model)
    registers = Registrar(registrar)
    return Stages(detects, Segmenter(segmenter), registers), registers.close
