# SPDX-License-Identifier: Apache-2.0
"""What every kind of detection model obeys: it reads the model's answer and says how it wants its picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.detector.picture import Look
from objreg_ros.detector.runtime import Port


@dataclass(frozen=True)
class Candidates:
    """Boxes before suppression, ``xyxy (N, 4)`` in 0..1 of the model's picture: 0 and 1 are its outer edges.

    ``score (N,)`` is as the model gives it, ``index (N,)`` that of the class, from 0. A segmentation head gives masks:
    ``coefficients (N, M)`` of the ``prototypes (M, h, w)``, which show the model's picture; else both are None.
    """

    xyxy: Array
    score: Array
    index: Array
    coefficients: Array | None = None
    prototypes: Array | None = None


class Contract(Protocol):
    """Reads a model's answer."""

    @property
    def names(self) -> tuple[str, ...]:
        """The outputs that `read` needs, in its order."""

    @property
    def look(self) -> Look:
        """How the family wants its picture."""

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """The boxes of score ``threshold`` and more, classes counted from 0; ValueError for an answer out of shape."""


@dataclass(frozen=True)
class Graph:
    """What is known of a model: its ports, its metadata and ``probe``, its answer to a test picture of size ``hw``.

    ``labels`` is how many names there are, ``offset`` the parameter ``label_offset``.
    """

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    metadata: Mapping[str, str]
    probe: Mapping[str, Array]
    labels: int
    offset: str
    hw: tuple[int, int]

    @property
    def head(self) -> str | None:
        """The name of the first output of three dimensions and one picture; None where there is none."""
        return next((name for name, value in self.probe.items() if value.ndim == 3 and len(value) == 1), None)

    @property
    def prototypes(self) -> str | None:
        """The name of the one other output, ``[1,M,h,w]``, of a segmentation head; None where there is none."""
        square = [name for name, value in self.probe.items() if value.ndim == 4 and len(value) == 1]
        return square[0] if len(square) == 1 and len(self.probe) == 2 else None

    @property
    def masks(self) -> int:
        """How many coefficients a box's mask has, by the prototypes of a segmentation head; 0 without."""
        return 0 if self.prototypes is None else int(self.probe[self.prototypes].shape[1])

    def names(self, head: str) -> tuple[str, ...]:
        """The outputs to read: the head, and the prototypes where there are."""
        return (head,) if self.prototypes is None else (head, self.prototypes)


def class_index(classes: Array, first: int, labels: int) -> Array:
    """Class numbers ``(N,)`` of a model counted from 0; ValueError for one without a label."""
    index = np.rint(classes).astype(np.int64) - first
    if len(index) and not 0 <= index.min() <= index.max() < labels:
        raise ValueError(
            f"class of a box: expected one of {labels} labels, got number {index.min()} to {index.max()} "
            "counted from 0; give the model's own file of `labels`, or set `label_offset`"
        )
    return index


def corners(cxcywh: Array) -> Array:
    """Boxes x_min y_min x_max y_max ``(N, 4)`` from cx cy w h."""
    half = cxcywh[:, 2:] / 2
    return np.concatenate([cxcywh[:, :2] - half, cxcywh[:, :2] + half], axis=1)


def best_class(scores: Array, threshold: float) -> tuple[Array, Array, Array]:
    """Of class scores ``(C, N)``: the rows whose best one reaches the threshold, that score and its class."""
    best = scores.max(axis=0)
    rows = np.flatnonzero(best >= threshold)
    return rows, best[rows].astype(np.float32), scores[:, rows].argmax(axis=0)


def require_rows(output: Array, expected: tuple[int, ...]) -> None:
    """ValueError where an answer has another shape than the one to the test picture."""
    if output.shape != expected:
        raise ValueError(f"answer of the model: expected {list(expected)}, got {list(output.shape)}; export it again")


def shapes(probe: Mapping[str, Array]) -> str:
    """Outputs and their shapes as text."""
    return ", ".join(f"{name} {list(value.shape)}" for name, value in probe.items())
