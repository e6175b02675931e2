# SPDX-License-Identifier: Apache-2.0
"""The beginning of a recording as a run would take it, without a detector and a registrar: what would be dropped, and
what of the stream is not as it says. It costs what decoding costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.data.images import ColourImage, DepthImage, Detections
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.segmenter.gravity.gravity_choice import GravityChoice
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.sensor.sensor_estimate import SensorEstimate
from objreg_ros.segmenter.sensor.view import reduced_view, step_for
from objreg_tools.offline.line import LineParams, run_offline
from objreg_tools.offline.run import Run
from objreg_tools.offline.stages import Stages
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import camera_frame, frame_tree, moving_topics
from objreg_tools.recording.record import Record, Recording

FRAMES = 400  # that are looked at: most cameras have turned enough by then


class SeesNothing:
    """In place of a detector."""

    def detect(self, image: ColourImage) -> Detections:
        return Detections(
            xyxy=np.zeros((0, 4), np.float32),
            score=np.zeros(0, np.float32),
            label=(),
            image_hw=image.rgb.shape[:2],
            stamp_ns=image.stamp_ns,
            frame_id=image.frame_id,
        )


class _CutsNothing:
    """In place of a segmenter: the view alone."""

    def __init__(self) -> None:
        self.choice, self.sensor = GravityChoice(None, 0.0, "nothing"), SensorEstimate()
        self._params = SegmenterParams()

    def segment(
        self,
        detections: Detections,
        depth: DepthImage,
        gravity: Array | None = None,
        *,
        gravity_sigma_deg: float | None = None,
    ) -> Frame:
        step = step_for(depth.intrinsics, self._params.view_step)
        view = reduced_view(depth, step, self._params.z_min, self._params.z_max)
        return Frame(
            objects=(),
            support=None,
            view=view,
            gravity=None,
            gravity_confidence=0.0,
            T_odom_camera=None,
            stamp_ns=depth.stamp_ns,
            frame_id=depth.frame_id,
        )


class _ClosesNothing:
    """In place of a registrar."""

    tracked = relocalised = None
    whereabouts = ""

    def counts(self) -> dict[str, int]:
        return {}

    def process(self, frame: Frame) -> Outcome:
        return Outcome()

    def finish(self, doubt: str = "") -> Outcome:
        return Outcome()


def rehearse(
    source: Recording,
    inputs: Inputs,
    frames: int = FRAMES,
    on_frame: Callable[[int], None] = lambda frames: None,
    params: LineParams | None = None,
) -> Run:
    """The run of the first ``frames`` of a recording. ``on_frame`` as in `run_offline`.

    ``params`` are those of the defaults where None.
    """
    stages = Stages(SeesNothing(), _CutsNothing(), _ClosesNothing())
    params = params or LineParams(frames=frame_tree(source, camera_frame(source, inputs)))
    return run_offline(_beginning(source, inputs, frames), stages, inputs, params, on_frame=on_frame)


def _beginning(source: Recording, inputs: Inputs, frames: int) -> Iterator[Record]:
    """The records that the graph takes, until ``frames`` of depth have come."""
    depth = inputs.depth or inputs.points
    for record in source.records({*inputs.chosen().values(), *moving_topics(source)}):
        yield record
        frames -= record.topic == depth
        if frames <= 0:
            return
