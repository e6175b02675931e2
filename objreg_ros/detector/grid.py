# SPDX-License-Identifier: Apache-2.0
"""Heads whose rows are the cells of a grid, and whose boxes are relative to them: YOLOX and NanoDet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.detector.contract import Candidates, Graph, best_class, corners, require_rows
from objreg_ros.detector.picture import Look
from objreg_ros.detector.yolo import in_shares

STRIDES = ((8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32), (16, 32))
"""The grids of known models, in pixels of a cell."""


def cells(hw: tuple[int, int], strides: tuple[int, ...]) -> int:
    """How many cells grids of such strides have."""
    return sum(-(-hw[0] // stride) * -(-hw[1] // stride) for stride in strides)


def strides_of(rows: int, hw: tuple[int, int]) -> tuple[int, ...] | None:
    """The strides of the grids that have that many cells; None where none of the known ones do."""
    return next((strides for strides in STRIDES if cells(hw, strides) == rows), None)


def grid(hw: tuple[int, int], strides: tuple[int, ...]) -> Array:
    """The cells ``(N, 3)`` in the order of the heads: their column and row, counted, and their stride in pixels."""
    parts = []
    for stride in strides:
        row, column = np.mgrid[: -(-hw[0] // stride), : -(-hw[1] // stride)].reshape(2, -1)
        parts.append(np.stack([column, row, np.full_like(row, stride)], axis=1))
    return np.concatenate(parts).astype(np.float32)


def _require_grid(rows: int, hw: tuple[int, int]) -> tuple[int, ...]:
    strides = strides_of(rows, hw)
    if strides is None:
        known = ", ".join(f"{cells(hw, one)} for strides {one}" for one in STRIDES)
        raise ValueError(f"head of the model: expected a row for each cell of {hw[1]} x {hw[0]} pixels ({known}), "
                         f"got {rows}; export it for the size of its input")  # fmt: skip
    return strides


@dataclass(frozen=True)
class YoloX:
    """Rows ``[1,N,5+C]`` of centre and log of size in cells, objectness and class scores (Ge et al., "YOLOX", 2021)."""

    names: tuple[str, ...]
    labels: int
    shape: tuple[int, ...]
    hw: tuple[int, int]
    grid: Array
    look: ClassVar[Look] = Look(fit="corner", bgr=True, mean=0.0, scale=1.0)

    @classmethod
    def of(cls, graph: Graph, head: str) -> YoloX:
        """The contract of that output; ValueError where its rows are of no known grid."""
        probe = graph.probe[head]
        if probe[0, :, :2].max(initial=0) > min(graph.hw) / 2:  # no cell has a centre that far away
            raise ValueError(
                f"head of the model: expected YOLOX's offsets from cells, got centres up to {probe[0, :, :2].max():g}; "
                "export it without decode_in_inference, or name yolov5 as its `contract` if it is a YOLOv6"
            )
        cell = grid(graph.hw, _require_grid(probe.shape[1], graph.hw))
        return cls((head,), graph.labels, probe.shape, graph.hw, cell)

    @staticmethod
    def fits(graph: Graph, shape: tuple[int, ...]) -> bool:
        """Whether the number of labels is that of such a head."""
        return shape[2] == 5 + graph.labels and graph.masks == 0

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        require_rows(outputs[0], self.shape)
        likely = np.flatnonzero(outputs[0][0, :, 4] >= threshold)
        row, cell = outputs[0][0, likely], self.grid[likely]
        rows, score, index = best_class((row[:, 5:] * row[:, 4:5]).T, threshold)
        row, cell = row[rows], cell[rows]
        centre = (row[:, :2] + cell[:, :2]) * cell[:, 2:]
        size = np.exp(np.minimum(row[:, 2:4], 20.0)) * cell[:, 2:]
        return Candidates(in_shares(corners(np.concatenate([centre, size], axis=1)), self.hw), score, index)


@dataclass(frozen=True)
class NanoDet:
    """Rows ``[1,N,C+4(R+1)]`` of class scores and, for each side of a box, how likely it is 0 … R cells away.

    Li et al., "Generalized Focal Loss", 2020. NanoDet-Plus, of four strides, counts from a cell's corner and sees
    pictures stretched; the older ones count from its middle and see them as they are, black around: these are refused.
    """

    names: tuple[str, ...]
    labels: int
    shape: tuple[int, ...]
    hw: tuple[int, int]
    grid: Array
    look: ClassVar[Look] = Look(
        bgr=True, mean=(103.53, 116.28, 123.675), scale=(1 / 57.375, 1 / 57.12, 1 / 58.395)
    )  # fmt: skip

    @classmethod
    def of(cls, graph: Graph, head: str) -> NanoDet:
        """The contract of that output; ValueError where its rows are not those of NanoDet-Plus."""
        shape = graph.probe[head].shape
        strides = _require_grid(shape[1], graph.hw)
        if strides != (8, 16, 32, 64) or not cls.fits(graph, shape):
            raise ValueError(f"head of the model: expected NanoDet-Plus, [1, {cells(graph.hw, (8, 16, 32, 64))}, C + "
                             f"4 (R + 1)] for {graph.labels} labels, got {list(shape)}; name its own "
                             "`contract`, and give its own `labels`")  # fmt: skip
        return cls((head,), graph.labels, shape, graph.hw, grid(graph.hw, strides))

    @staticmethod
    def fits(graph: Graph, shape: tuple[int, ...]) -> bool:
        """Whether what is left beside the labels are bins for four sides."""
        bins, rest = divmod(shape[2] - graph.labels, 4)
        return rest == 0 and 2 <= bins <= 33 and graph.masks == 0

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        require_rows(outputs[0], self.shape)
        rows, score, index = best_class(outputs[0][0, :, : self.labels].T, threshold)
        bins = outputs[0][0, rows, self.labels :].reshape(len(rows), 4, -1)
        likelihood = np.exp(bins - bins.max(axis=2, keepdims=True))
        likelihood /= likelihood.sum(axis=2, keepdims=True)
        away = likelihood @ np.arange(bins.shape[2], dtype=np.float32)
        cell = self.grid[rows]
        xyxy = (np.tile(cell[:, :2], 2) + away * np.array([-1, -1, 1, 1], np.float32)) * cell[:, 2:]
        return Candidates(in_shares(xyxy, self.hw), score, index)
