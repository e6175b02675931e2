# SPDX-License-Identifier: Apache-2.0
"""The detector: a picture goes in, named boxes come out, with masks where the model makes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.detector.boxes import area, clip, suppress
from objreg_ros.detector.contract import Candidates, Contract, Graph
from objreg_ros.detector.labels import NO_CLASS, find_labels
from objreg_ros.detector.masks import draw_masks
from objreg_ros.detector.params import DetectorParams
from objreg_ros.detector.picture import Picture
from objreg_ros.detector.recognise import recognise
from objreg_ros.detector.runtime import Runtime
from objreg_ros.detector.tf_detection import TfDetection
from objreg_ros.detector.threshold import own_threshold


class Detector:
    """Any ONNX detection model behind one verb.

    A model that keeps none of the contracts (docs/models-contract.md) is refused here: ValueError with expected, got,
    and what to do. The model has run once when this returns.
    """

    def __init__(self, params: DetectorParams, model_path: Path, labels_path: Path | None = None):
        self.params = params
        self._own_threshold = own_threshold(Path(model_path))
        self._runtime = Runtime(Path(model_path), params.threads)
        runtime = self._runtime
        self._picture = Picture.of(runtime.inputs, runtime.metadata)
        hw = self._picture.usual_hw(runtime.metadata)
        graph = Graph(runtime.inputs, runtime.outputs, runtime.metadata, self._probe(hw), 0, params.label_offset, hw)

        def recognised(labels: tuple[str, ...]) -> Contract:
            return recognise(replace(graph, labels=len(labels)), params.contract)

        self.labels = find_labels(Path(model_path), labels_path, runtime.metadata, recognised)
        self._contract = recognised(self.labels)
        if not isinstance(self._contract, TfDetection):  # others are for pictures of one size
            self._picture = self._picture.sized(*hw)
        self._picture = self._picture.asked(self._contract.look, runtime.metadata)

    @classmethod
    def of(cls, params: DetectorParams, find_model: Callable[[str], Path]) -> Detector:
        """The detector that the parameters name; ``find_model`` gives the file of a model's name."""
        labels = Path(params.labels).expanduser() if params.labels else None
        return cls(params, find_model(params.model), labels)

    @property
    def threshold(self) -> float:
        """The least score of a detection: that of the parameters, or the model's own."""
        return self.params.threshold or self._own_threshold

    def detect(self, image: ColourImage) -> Detections:
        """What is in ``image``, best first; no detections (N = 0) when nothing reaches the threshold."""
        height, width = image.rgb.shape[:2]
        if height == 0 or width == 0:
            raise ValueError(f"image: expected at least one pixel, got {width} x {height}")
        outputs = self._run(image.rgb, self._contract.names)
        candidates = self._contract.read(outputs, self.threshold)
        place = self._picture.place(image.rgb)
        xyxy = clip(place.to_image(candidates.xyxy), height, width).astype(np.float32)
        chosen = self._choose(xyxy, candidates, height * width)
        found = Detections(
            xyxy=xyxy[chosen],
            score=np.clip(candidates.score[chosen], 0, 1).astype(np.float32),
            label=tuple(self.labels[index] for index in candidates.index[chosen]),
            image_hw=(height, width),
            stamp_ns=image.stamp_ns,
            frame_id=image.frame_id,
        )
        return replace(found, instances=draw_masks(found, candidates, chosen, place))

    def _choose(self, xyxy: Array, candidates: Candidates, image_area: int) -> Array:
        """The rows that go on, best first."""
        p = self.params
        unwanted = [index for index, label in enumerate(self.labels) if label == NO_CLASS or label in p.ignore]
        sides = xyxy[:, 2:] - xyxy[:, :2]
        good = np.isfinite(xyxy).all(axis=1) & (sides.min(axis=1, initial=np.inf) >= max(p.min_side, 1e-3))
        good &= (area(xyxy) <= p.max_area * image_area) & ~np.isin(candidates.index, unwanted)
        rows = np.flatnonzero(good)
        rows = rows[np.argsort(-candidates.score[rows], kind="stable")][: p.max_candidates]
        kept = suppress(xyxy[rows], candidates.index[rows], p.nms_iou, p.cross_label_iou)
        return rows[kept][: p.max_detections]

    def _run(self, rgb: Array, names: tuple[str, ...]) -> list[Array]:
        """The named outputs for a picture; half floats become whole ones."""
        tensor = self._picture.tensor(rgb)
        outputs = map(np.asarray, self._runtime.run(tensor, names, self._picture.extra(tensor)))
        return [value.astype(np.float32) if value.dtype == np.float16 else value for value in outputs]

    def _probe(self, hw: tuple[int, int]) -> dict[str, Array]:
        """The model's answer to a grey picture, by output. Running it also warms the model up."""
        names = tuple(port.name for port in self._runtime.outputs)
        return dict(zip(names, self._run(np.full((*hw, 3), 127, np.uint8), names), strict=True))
