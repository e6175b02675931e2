# SPDX-License-Identifier: Apache-2.0
"""Detections after the model's own suppression, as TF's detection graphs and TFLite's operation give them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import ClassVar

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.detector.contract import Candidates, Graph, class_index, shapes
from objreg_ros.detector.picture import Look
from objreg_ros.detector.runtime import Port

TFLITE_OP = "TFLite_Detection_PostProcess"


@dataclass(frozen=True)
class TfDetection:
    """Boxes, classes, scores [, count] after the model's own suppression, as TF's detection graphs give them."""

    names: tuple[str, ...]
    first: int
    labels: int
    look: ClassVar[Look] = Look()

    @classmethod
    def of(cls, graph: Graph) -> TfDetection:
        """The contract of a graph with such outputs, under whatever names."""
        probe = graph.probe
        roles = _roles(graph.outputs, probe)
        missing = [role for role in ("boxes", "classes", "scores") if role not in roles]
        rows = {probe[name].shape[1] for role, name in roles.items() if role != "count"}
        if missing or len(rows) > 1:
            raise ValueError(
                f"outputs of the model: expected boxes [1,N,4], classes [1,N], scores [1,N] [, count [1]], got "
                f"{shapes(probe)}; export the model with its post-processing"
            )
        names = tuple(roles[role] for role in ("boxes", "classes", "scores", "count") if role in roles)
        first = int(graph.offset) if graph.offset != "auto" else _first_class(graph.inputs, names)
        return cls(names, first, graph.labels)

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        boxes, classes, scores = (output[0] for output in outputs[:3])
        count = _count(outputs[3]) if len(outputs) > 3 else len(scores)
        good = (np.arange(len(scores)) < count) & (scores >= threshold) & ~_padding(boxes, scores)
        index = class_index(classes[good], self.first, self.labels)
        return Candidates(boxes[good][:, [1, 0, 3, 2]].astype(np.float32), scores[good].astype(np.float32), index)


def _count(output: Array) -> int:
    """How many boxes a model says that it gives."""
    said = float(output.reshape(-1)[0])
    if not math.isfinite(said):
        raise ValueError(f"count of the model: expected how many boxes there are, got {said}; export the model again")
    return int(said)


def _padding(boxes: Array, scores: Array) -> Array:
    """Which rows (N,) bool only fill the model's answer up: neither a score nor an area."""
    return np.asarray((scores <= 0.0) & (boxes[:, :2] >= boxes[:, 2:]).any(axis=1))


def _roles(outputs: tuple[Port, ...], probe: Mapping[str, Array]) -> dict[str, str]:
    """Which output is boxes, classes, scores and count: by shape, then by name, then by what the probe gave."""
    roles: dict[str, str] = {}
    flat: list[str] = []
    for name in (port.name for port in outputs if not port.name.startswith("raw_")):
        shape = probe[name].shape
        if len(shape) == 3 and shape[0] == 1 and shape[2] == 4:
            roles.setdefault("boxes", name)
        elif len(shape) == 2 and shape[0] == 1:
            flat.append(name)
        elif probe[name].size == 1:
            roles.setdefault("count", name)
    if len(flat) < 2:
        return roles
    classes, scores = _named(flat) or _by_values({name: probe[name] for name in flat})
    return roles | {"classes": classes, "scores": scores}


def _named(flat: list[str]) -> tuple[str, str] | None:
    """The names of classes and scores, where they say it, or are those of TFLite's own operation; else None."""
    if all(name.startswith(TFLITE_OP) for name in flat):
        classes, scores, *_ = sorted(flat)  # :1 and :2; the boxes have no number
        return classes, scores
    by_class = [name for name in flat if any(word in name.lower() for word in ("class", "label"))]
    by_score = [name for name in flat if "score" in name.lower() and name not in by_class]
    if len(flat) == 2 and len(by_class) + len(by_score) == 1:  # one is named, so the other is the other
        by_class = by_class or [name for name in flat if name not in by_score]
        by_score = by_score or [name for name in flat if name not in by_class]
    return (by_class[-1], by_score[-1]) if by_class and by_score else None


def _by_values(flat: Mapping[str, Array]) -> tuple[str, str]:
    """The names of classes and scores by their values: whole numbers, and 0 … 1. ValueError unless one pair fits.

    The order does not help: TFLite's operation has classes before scores, TF2's export scores before classes.
    """
    whole = {name for name, values in flat.items() if (np.rint(values) == values).all()}
    shares = {name for name, values in flat.items() if ((values >= 0) & (values <= 1 + 1e-3)).all()}
    pairs = [pair for pair in permutations(flat, 2) if pair[0] in whole and pair[1] in shares]
    if len(pairs) != 1:
        may = "either" if pairs else "neither"
        raise ValueError(
            "outputs of the model: expected names or values that distinguish the classes from the scores, got "
            f"{shapes(flat)}, which by their values may be {may}; export it again, or rename "
            "its outputs, with `classes` in the name of the one and `scores` in that of the other"
        )
    return pairs[0]


def _first_class(inputs: tuple[Port, ...], names: tuple[str, ...]) -> int:
    """1 for a graph of TF's object detection API, which counts the background; 0 for one that went through TFLite."""
    api_input = inputs[0].name.split(":")[0] in ("image_tensor", "input_tensor", "ToFloat")
    return int(api_input or any(name.startswith("detection_") for name in names))
