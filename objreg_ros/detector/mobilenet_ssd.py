# SPDX-License-Identifier: Apache-2.0
"""The detector: a picture goes in, named boxes come out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from objreg_ros.data import Array, ColourImage, Detections
from objreg_ros.detector.boxes import area, clip, suppress
from objreg_ros.detector.contract import Candidates, RawSsd, recognise
from objreg_ros.detector.labels import UNNAMED, find_labels
from objreg_ros.detector.params import DetectorParams
from objreg_ros.detector.picture import Picture
from objreg_ros.detector.runtime import Runtime

PROBE_SIZE = (480, 640)
"""Height and width of the test picture of a model that takes any size."""


class Detector:
    """Any SSD-style ONNX model behind one verb.

    A model that keeps none of the two contracts (post-processed TF detection, or raw SSD heads with priors in the
    metadata) is refused here: ValueError with expected, got, and what to do. The model has run once when this returns.
    """

    def __init__(self, params: DetectorParams, model_path: Path, labels_path: Path | None = None):
        self.params = params
        self._runtime = Runtime(Path(model_path), params.threads)
        self.labels = find_labels(Path(model_path), labels_path, self._runtime.metadata)
        self._picture = Picture.of(self._runtime.inputs, self._runtime.metadata)
        self._contract = recognise(
            self._runtime.inputs, self._runtime.outputs, self._runtime.metadata, self._probe(),
            len(self.labels), params.label_offset,
        )  # fmt: skip
        if isinstance(self._contract, RawSsd):  # whose priors are for pictures of one size
            self._picture = self._picture.sized(*PROBE_SIZE)

    @classmethod
    def of(cls, params: DetectorParams, find_model: Callable[[str], Path]) -> Detector:
        """The detector that the parameters name; ``find_model`` gives the file of a model's name."""
        labels = Path(params.labels).expanduser() if params.labels else None
        return cls(params, find_model(params.model), labels)

    def detect(self, image: ColourImage) -> Detections:
        """What is in ``image``, best first; no detections (N = 0) when nothing reaches the threshold."""
        height, width = image.rgb.shape[:2]
        if height == 0 or width == 0:
            raise ValueError(f"image: expected at least one pixel, got {width} x {height}")
        outputs = self._runtime.run(self._picture.tensor(image.rgb), self._contract.names)
        candidates = self._contract.read(outputs, self.params.threshold)
        scaled = candidates.xyxy * np.array([width, height, width, height], np.float32)
        xyxy = clip(scaled, height, width).astype(np.float32)
        chosen = self._choose(xyxy, candidates, height * width)
        return Detections(
            xyxy=xyxy[chosen],
            score=np.clip(candidates.score[chosen], 0, 1).astype(np.float32),
            label=tuple(self.labels[index] for index in candidates.index[chosen]),
            image_hw=(height, width),
            stamp_ns=image.stamp_ns,
            frame_id=image.frame_id,
        )

    def _choose(self, xyxy: Array, candidates: Candidates, image_area: int) -> Array:
        """The rows that go on, best first."""
        p = self.params
        unwanted = [index for index, label in enumerate(self.labels) if label == UNNAMED or label in p.ignore]
        sides = xyxy[:, 2:] - xyxy[:, :2]
        good = np.isfinite(xyxy).all(axis=1) & (sides.min(axis=1, initial=np.inf) >= max(p.min_side, 1e-3))
        good &= (area(xyxy) <= p.max_area * image_area) & ~np.isin(candidates.index, unwanted)
        rows = np.flatnonzero(good)
        rows = rows[np.argsort(-candidates.score[rows], kind="stable")][: p.max_candidates]
        kept = suppress(xyxy[rows], candidates.index[rows], p.nms_iou, p.cross_label_iou)
        return rows[kept][: p.max_detections]

    def _probe(self) -> dict[str, Array]:
        """The model's answer to a grey picture, by output. Running it also warms the model up."""
        size = (self._picture.height or PROBE_SIZE[0], self._picture.width or PROBE_SIZE[1])
        names = tuple(port.name for port in self._runtime.outputs)
        answer = self._runtime.run(self._picture.tensor(np.full((*size, 3), 127, np.uint8)), names)
        return dict(zip(names, (np.asarray(value) for value in answer), strict=True))
