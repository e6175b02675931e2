# SPDX-License-Identifier: Apache-2.0
"""The two kinds of answer that a detection model gives, and the one word that they become."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import Protocol

import numpy as np

from objreg_ros.data import Array
from objreg_ros.detector.boxes import decode
from objreg_ros.detector.runtime import Port

RAW_CONTRACT = "ssd_raw/1"
TFLITE_OP = "TFLite_Detection_PostProcess"


@dataclass(frozen=True)
class Candidates:
    """Boxes before suppression: ``xyxy (N, 4)`` in 0..1 of the image, ``score (N,)``, ``index (N,)`` of the class."""

    xyxy: Array
    score: Array
    index: Array


class Contract(Protocol):
    """Reads a model's answer."""

    @property
    def names(self) -> tuple[str, ...]:
        """The outputs that `read` needs, in its order."""

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """The boxes of score ``threshold`` and more, classes counted from 0; ValueError for an answer out of shape."""


def recognise(
    inputs: tuple[Port, ...], outputs: tuple[Port, ...], metadata: Mapping[str, str], probe: Mapping[str, Array],
    labels: int, offset: str,
) -> Contract:  # fmt: skip
    """The contract that a graph keeps, told by its outputs; ``probe`` is its answer to a test picture.

    ValueError says what was expected and what the graph has.
    """
    if "objreg.contract" in metadata or {"loc", "logits"} <= set(probe):
        return RawSsd.of(probe, metadata, labels)
    return TfDetection.of(inputs, outputs, probe, labels, offset)


@dataclass(frozen=True)
class TfDetection:
    """Boxes, classes, scores [, count] after the model's own suppression, as TF's detection graphs give them."""

    names: tuple[str, ...]
    first: int
    labels: int

    @classmethod
    def of(
        cls, inputs: tuple[Port, ...], outputs: tuple[Port, ...], probe: Mapping[str, Array], labels: int, offset: str
    ) -> TfDetection:
        """The contract of a graph with such outputs, under whatever names."""
        roles = _roles(outputs, probe)
        missing = [role for role in ("boxes", "classes", "scores") if role not in roles]
        rows = {probe[name].shape[1] for role, name in roles.items() if role != "count"}
        if missing or len(rows) > 1:
            raise ValueError(
                "outputs of the model: expected boxes [1,N,4], classes [1,N], scores [1,N] [, count [1]], or loc "
                f"[1,A,4] and logits [1,A,1+C] with objreg.contract = {RAW_CONTRACT}, got {_shapes(probe)}; "
                "export the model with its post-processing"
            )
        names = tuple(roles[role] for role in ("boxes", "classes", "scores", "count") if role in roles)
        first = int(offset) if offset != "auto" else _first_class(inputs, names)
        return cls(names, first, labels)

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        boxes, classes, scores = (output[0] for output in outputs[:3])
        count = _count(outputs[3]) if len(outputs) > 3 else len(scores)
        good = (np.arange(len(scores)) < count) & (scores >= threshold) & ~_padding(boxes, scores)
        index = np.rint(classes[good]).astype(np.int64) - self.first
        if len(index) and not 0 <= index.min() <= index.max() < self.labels:
            raise ValueError(
                f"class of a box: expected one of {self.labels} labels, got number {index.min()} to {index.max()} "
                "counted from 0; give the model's own file of `labels`, or set `label_offset`"
            )
        return Candidates(boxes[good][:, [1, 0, 3, 2]].astype(np.float32), scores[good].astype(np.float32), index)


@dataclass(frozen=True)
class RawSsd:
    """``loc [1,A,4]`` and ``logits [1,A,1+C]`` with the priors in the metadata (Liu et al., "SSD", 2016)."""

    names: tuple[str, ...]
    priors: Array
    variances: Array

    @classmethod
    def of(cls, probe: Mapping[str, Array], metadata: Mapping[str, str], labels: int) -> RawSsd:
        """The contract of a graph with raw heads; ValueError when heads, priors and labels do not fit each other."""
        got = _shapes(probe)
        if metadata.get("objreg.contract") != RAW_CONTRACT or not {"loc", "logits"} <= set(probe):
            contract = metadata.get("objreg.contract")
            raise ValueError(f"model: expected objreg.contract {RAW_CONTRACT} with outputs loc and logits, "
                             f"got {contract!r} with {got}; export it again with this version")  # fmt: skip
        priors, variances = _priors(metadata), _variances(metadata)
        expected = {"loc": (1, len(priors), 4), "logits": (1, len(priors), labels + 1)}
        if any(probe[name].shape != shape for name, shape in expected.items()):
            raise ValueError(f"heads of the model: expected {expected} from {len(priors)} priors and {labels} labels, "
                             f"got {got}; give the labels and priors that it was trained with")  # fmt: skip
        return cls(("loc", "logits"), priors, variances)

    def read(self, outputs: list[Array], threshold: float) -> Candidates:
        """See `Contract`."""
        shapes = [output.shape[:2] for output in outputs]
        if shapes != [(1, len(self.priors))] * 2:
            raise ValueError(
                f"heads of the model: expected a row for each of {len(self.priors)} priors, got {shapes[0]} and "
                f"{shapes[1]}; export the model with the one input size that its priors are for"
            )
        likely = np.flatnonzero(_may_reach(outputs[1][0], threshold))
        score = _softmax(outputs[1][0][likely].astype(np.float32))[:, 1:]
        rows, index = np.nonzero(score >= threshold)
        chosen = likely[rows]
        xyxy = decode(outputs[0][0][chosen].astype(np.float32), self.priors[chosen], self.variances)
        return Candidates(xyxy, score[rows, index], index)


def _count(output: Array) -> int:
    """How many boxes a model says that it gives."""
    said = float(output.reshape(-1)[0])
    if not math.isfinite(said):
        raise ValueError(f"count of the model: expected how many boxes there are, got {said}; export the model again")
    return int(said)


def _padding(boxes: Array, scores: Array) -> Array:
    """Which rows (N,) bool only fill the model's answer up: neither a score nor an area."""
    return np.asarray((scores <= 0.0) & (boxes[:, :2] >= boxes[:, 2:]).any(axis=1))


def _may_reach(logits: Array, threshold: float) -> Array:
    """Which rows ``(A,) bool`` may have a class of that softmax; the odds against the background rule most out."""
    least = math.log(max(threshold, 1e-9) / max(1.0 - threshold, 1e-9)) - 1e-3
    by_class = np.ascontiguousarray(logits.T)  # the greatest of a few long rows is found six times as fast
    return by_class[1:].max(axis=0) - by_class[0] >= least


def _softmax(logits: Array) -> Array:
    exponent = np.exp(logits - logits.max(axis=1, keepdims=True, initial=-np.inf))
    return exponent / exponent.sum(axis=1, keepdims=True)


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
    classes, scores = _named(flat) or _told_apart({name: probe[name] for name in flat})
    return roles | {"classes": classes, "scores": scores}


def _named(flat: list[str]) -> tuple[str, str] | None:
    """The names of classes and scores, where the names tell, or are those of TFLite's own operation; else None."""
    if all(name.startswith(TFLITE_OP) for name in flat):
        classes, scores, *_ = sorted(flat)  # :1 and :2; the boxes have no number
        return classes, scores
    by_class = [name for name in flat if any(word in name.lower() for word in ("class", "label"))]
    by_score = [name for name in flat if "score" in name.lower() and name not in by_class]
    if len(flat) == 2 and len(by_class) + len(by_score) == 1:  # one is named, so the other is the other
        by_class = by_class or [name for name in flat if name not in by_score]
        by_score = by_score or [name for name in flat if name not in by_class]
    return (by_class[-1], by_score[-1]) if by_class and by_score else None


def _told_apart(flat: Mapping[str, Array]) -> tuple[str, str]:
    """The names of classes and scores by their values: whole numbers, and 0 … 1. ValueError where that tells nothing.

    The order tells nothing either: TFLite's operation has classes before scores, TF2's export scores before classes.
    """
    whole = {name for name, values in flat.items() if (np.rint(values) == values).all()}
    shares = {name for name, values in flat.items() if ((values >= 0) & (values <= 1 + 1e-3)).all()}
    pairs = [pair for pair in permutations(flat, 2) if pair[0] in whole and pair[1] in shares]
    if len(pairs) != 1:
        may = "either" if pairs else "neither"
        raise ValueError(
            "outputs of the model: expected names or values that tell the classes from the scores, got "
            f"{_shapes(flat)}, which by their values may be {may}; export it again, or rename "
            "its outputs, with `classes` in the name of the one and `scores` in that of the other"
        )
    return pairs[0]


def _first_class(inputs: tuple[Port, ...], names: tuple[str, ...]) -> int:
    """1 for a graph of TF's object detection API, which counts the background; 0 for one that went through TFLite."""
    api_input = inputs[0].name.split(":")[0] in ("image_tensor", "input_tensor", "ToFloat")
    return int(api_input or any(name.startswith("detection_") for name in names))


def _priors(metadata: Mapping[str, str]) -> Array:
    try:
        raw = np.frombuffer(base64.b64decode(metadata["objreg.priors"], validate=True), "<f4")
        priors = raw.reshape(-1, 4).astype(np.float32)
    except (KeyError, ValueError) as error:
        raise ValueError(f"objreg.priors: expected base64 of float32 [A,4], got {error!r}") from error
    bad = ~(np.isfinite(priors).all(axis=1) & (priors[:, 2:] > 0).all(axis=1))
    if bad.any():
        first = int(bad.argmax())
        raise ValueError(
            "objreg.priors: expected finite cx cy w h with w and h above 0, got "
            f"{bad.sum()} of {len(priors)} that are not, the first {priors[first].tolist()} in row {first}; "
            "export the model again"
        )
    return priors


def _variances(metadata: Mapping[str, str]) -> Array:
    text = metadata.get("objreg.variances", "[0.1, 0.1, 0.2, 0.2]")
    try:
        variances = np.asarray(json.loads(text), np.float32).reshape(4)
    except (ValueError, TypeError, RecursionError, OverflowError) as error:
        raise ValueError(f"objreg.variances: expected a list of 4 numbers, got {text[:80]!r}") from error
    if not (np.isfinite(variances) & (variances >= 0)).all():
        raise ValueError(f"objreg.variances: expected 4 finite numbers that are not negative, got {text[:80]!r}")
    return variances


def _shapes(probe: Mapping[str, Array]) -> str:
    return ", ".join(f"{name} {list(value.shape)}" for name, value in probe.items())
