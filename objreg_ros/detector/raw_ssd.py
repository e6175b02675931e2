# SPDX-License-Identifier: Apache-2.0
"""Raw heads of an SSD, whose priors are in the model's metadata."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.detector.boxes import decode
from objreg_ros.detector.contract import Candidates, Graph, shapes
from objreg_ros.detector.picture import AGAIN, Look

RAW_CONTRACT = "ssd_raw/1"


@dataclass(frozen=True)
class RawSsd:
    """``loc [1,A,4]`` and ``logits [1,A,1+C]`` with the priors in the metadata (Liu et al., "SSD", 2016)."""

    names: tuple[str, ...]
    priors: Array
    variances: Array
    look: ClassVar[Look] = Look()

    @classmethod
    def of(cls, graph: Graph) -> RawSsd:
        """The contract of a graph with raw heads; ValueError when heads, priors and labels do not fit each other."""
        probe, metadata, labels = graph.probe, graph.metadata, graph.labels
        got = shapes(probe)
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


def _may_reach(logits: Array, threshold: float) -> Array:
    """Which rows ``(A,) bool`` may have a class of that softmax; the odds against the background rule most out."""
    least = math.log(max(threshold, 1e-9) / max(1.0 - threshold, 1e-9)) - 1e-3
    by_class = np.ascontiguousarray(logits.T)  # the greatest of a few long rows is found six times as fast
    return by_class[1:].max(axis=0) - by_class[0] >= least


def _softmax(logits: Array) -> Array:
    exponent = np.exp(logits - logits.max(axis=1, keepdims=True, initial=-np.inf))
    return exponent / exponent.sum(axis=1, keepdims=True)


def _priors(metadata: Mapping[str, str]) -> Array:
    try:
        raw = np.frombuffer(base64.b64decode(metadata["objreg.priors"], validate=True), "<f4")
        priors = raw.reshape(-1, 4).astype(np.float32)
    except (KeyError, ValueError) as error:
        raise ValueError(
            f"objreg.priors: expected base64 of float32 [A,4], got {error!r}; export the model again"
        ) from error
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
        raise ValueError(f"objreg.variances: expected a list of 4 numbers, got {text[:80]!r}; {AGAIN}") from error
    if not (np.isfinite(variances) & (variances >= 0)).all():
        expected = "4 finite numbers that are not negative"
        raise ValueError(f"objreg.variances: expected {expected}, got {text[:80]!r}; {AGAIN}")
    return variances
