# SPDX-License-Identifier: Apache-2.0
"""Detection transformers that need no suppression: RT-DETR and D-FINE, in the three ways that they are exported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.detector.contract import Candidates, Graph, best_class, class_index, corners, shapes
from objreg_ros.detector.picture import Look
from objreg_ros.detector.yolo import in_shares

STRETCHED = Look(mean=0.0, scale=1 / 255)
DECODED, QUERIED = ("labels", "boxes", "scores"), ("logits", "pred_boxes")


@dataclass(frozen=True)
class DetrOutput:
    """``labels [1,N]``, ``boxes [1,N,4]`` x_min y_min x_max y_max and ``scores [1,N]``, as the authors export them.

    The boxes are in pixels of the size in the input orig_target_sizes, which gets that of the model's picture.
    """

    labels: int
    hw: tuple[int, int]
    names: ClassVar[tuple[str, ...]] = DECODED
    look: ClassVar[Look] = STRETCHED

    @classmethod
    def of(cls, graph: Graph) -> DetrOutput:
        """The contract of such outputs."""
        rows = graph.probe["labels"].shape
        if len(rows) != 2 or graph.probe["scores"].shape != rows or graph.probe["boxes"].shape != (*rows, 4):
            raise ValueError(f"outputs of the model: expected labels [1,N], boxes [1,N,4] and scores [1,N], "
                             f"got {shapes(graph.probe)}; export it again")  # fmt: skip
        return cls(graph.labels, graph.hw)

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        classes, boxes, scores = (output[0] for output in outputs)
        good = scores >= threshold
        index = class_index(classes[good], 0, self.labels)
        return Candidates(in_shares(boxes[good], self.hw), scores[good].astype(np.float32), index)


@dataclass(frozen=True)
class DetrQueries:
    """``logits [1,N,C]`` and ``pred_boxes [1,N,4]`` cx cy w h in 0..1, as Hugging Face's models give them."""

    names: ClassVar[tuple[str, ...]] = QUERIED
    look: ClassVar[Look] = STRETCHED

    @classmethod
    def of(cls, graph: Graph) -> DetrQueries:
        """The contract of such outputs; ValueError where the logits are not those of the labels."""
        boxes = graph.probe["pred_boxes"].shape
        if len(boxes) != 3 or graph.probe["logits"].shape != (*boxes[:2], graph.labels):
            raise ValueError(f"outputs of the model: expected logits [1,N,C] and pred_boxes [1,N,4] for {graph.labels} "
                             f"labels, got {shapes(graph.probe)}; give its own labels; a DETR with a class for "
                             "nothing is not supported")  # fmt: skip
        return cls()

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        scores = 1 / (1 + np.exp(-np.clip(outputs[0][0].astype(np.float32), -80, 80)))
        rows, score, index = best_class(scores.T, threshold)
        return Candidates(corners(outputs[1][0, rows].astype(np.float32)), score, index)


@dataclass(frozen=True)
class DetrRows:
    """Rows ``[1,N,4+C]`` of cx cy w h in 0..1 and class scores, as Ultralytics exports RT-DETR."""

    names: tuple[str, ...]
    look: ClassVar[Look] = STRETCHED

    @classmethod
    def of(cls, graph: Graph, head: str) -> DetrRows:
        """The contract of that output."""
        return cls((head,))

    @staticmethod
    def fits(graph: Graph, shape: tuple[int, ...]) -> bool:
        """Whether the number of labels is that of such a head."""
        return shape[2] == 4 + graph.labels and graph.masks == 0

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        rows, score, index = best_class(outputs[0][0, :, 4:].T, threshold)
        return Candidates(corners(outputs[0][0, rows, :4].astype(np.float32)), score, index)
