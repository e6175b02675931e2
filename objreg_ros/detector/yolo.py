# SPDX-License-Identifier: Apache-2.0
"""YOLO as Ultralytics and its kin export it: rows with objectness, columns without, and boxes that are chosen already.

Boxes are in pixels of the model's picture, which is centred on grey (Jocher et al., "Ultralytics YOLO").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.detector.contract import Candidates, Graph, best_class, class_index, corners, require_rows
from objreg_ros.detector.picture import Look

CENTRED = Look(fit="centre", mean=0.0, scale=1 / 255)


def in_shares(xyxy: Array, hw: tuple[int, int]) -> Array:
    """Boxes in pixels of a picture as shares of it, float32."""
    return (xyxy / np.array([hw[1], hw[0]] * 2, np.float32)).astype(np.float32)


def masks_of(outputs: list[Array], coefficients: Array) -> tuple[Array, Array] | tuple[()]:
    """Coefficients and prototypes of the boxes ``(N, M)`` that are read; nothing for a head without prototypes."""
    if len(outputs) == 1:
        return ()
    if outputs[1].ndim != 4 or outputs[1].shape[:2] != (1, coefficients.shape[1]):
        expected = f"[1, {coefficients.shape[1]}, h, w]"
        raise ValueError(f"prototypes of the model: expected {expected}, got {list(outputs[1].shape)}; export it again")
    return coefficients, outputs[1][0]


@dataclass(frozen=True)
class YoloV5:
    """Rows ``[1,N,5+C]`` of cx cy w h, objectness and class scores; YOLOv6 and YOLOv7 as well. Masks may follow."""

    names: tuple[str, ...]
    labels: int
    shape: tuple[int, ...]
    hw: tuple[int, int]
    look: ClassVar[Look] = CENTRED

    @classmethod
    def of(cls, graph: Graph, head: str) -> YoloV5:
        """The contract of that output."""
        return cls(graph.names(head), graph.labels, graph.probe[head].shape, graph.hw)

    @staticmethod
    def fits(graph: Graph, shape: tuple[int, ...]) -> bool:
        """Whether the number of labels is that of such a head."""
        return shape[2] == 5 + graph.labels + graph.masks

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        require_rows(outputs[0], self.shape)
        row = outputs[0][0]
        likely = row[row[:, 4] >= threshold]
        rows, score, index = best_class((likely[:, 5 : 5 + self.labels] * likely[:, 4:5]).T, threshold)
        masks = masks_of(outputs, likely[rows, 5 + self.labels :])
        return Candidates(in_shares(corners(likely[rows, :4]), self.hw), score, index, *masks)


@dataclass(frozen=True)
class YoloV8:
    """Columns ``[1,4+C,N]`` of cx cy w h and class scores, or rows ``[1,N,4+C]`` of them. Masks may follow."""

    names: tuple[str, ...]
    labels: int
    shape: tuple[int, ...]
    hw: tuple[int, int]
    by_row: bool
    look: ClassVar[Look] = CENTRED

    @classmethod
    def of(cls, graph: Graph, head: str) -> YoloV8:
        """The contract of that output."""
        shape = graph.probe[head].shape
        return cls(graph.names(head), graph.labels, shape, graph.hw, shape[1] != 4 + graph.labels + graph.masks)

    @staticmethod
    def fits(graph: Graph, shape: tuple[int, ...]) -> bool:
        """Whether the number of labels is that of such a head."""
        return 4 + graph.labels + graph.masks in shape[1:]

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        require_rows(outputs[0], self.shape)
        column = outputs[0][0].T if self.by_row else outputs[0][0]
        rows, score, index = best_class(column[4 : 4 + self.labels], threshold)
        masks = masks_of(outputs, column[4 + self.labels :, rows].T)
        return Candidates(in_shares(corners(column[:4, rows].T), self.hw), score, index, *masks)


@dataclass(frozen=True)
class EndToEnd:
    """Rows ``[1,N,6]`` of x_min y_min x_max y_max, score and class, after the model's own choice. Masks may follow."""

    names: tuple[str, ...]
    labels: int
    hw: tuple[int, int]
    look: ClassVar[Look] = CENTRED

    @classmethod
    def of(cls, graph: Graph, head: str) -> EndToEnd:
        """The contract of that output."""
        return cls(graph.names(head), graph.labels, graph.hw)

    @staticmethod
    def fits(graph: Graph, shape: tuple[int, ...]) -> bool:
        """Whether rows have the six numbers, whatever the number of labels."""
        return shape[2] == 6 + graph.masks

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        if outputs[0].ndim != 3 or outputs[0].shape[2] < 6:
            raise ValueError(f"answer of the model: expected [1, N, 6], got {list(outputs[0].shape)}; export it again")
        row = outputs[0][0]
        row = row[row[:, 4] >= threshold]
        index = class_index(row[:, 5], 0, self.labels)
        masks = masks_of(outputs, row[:, 6:])
        return Candidates(in_shares(row[:, :4], self.hw), row[:, 4].astype(np.float32), index, *masks)
