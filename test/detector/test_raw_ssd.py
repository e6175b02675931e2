# SPDX-License-Identifier: Apache-2.0
"""What the raw heads of an SSD mean."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from objreg_ros.detector.contract import Graph
from objreg_ros.detector.raw_ssd import RawSsd
from objreg_ros.detector.recognise import recognise
from objreg_ros.detector.runtime import Port

from .tiny_model import raw_metadata

PRIORS = np.array([[0.5, 0.5, 0.2, 0.2], [0.25, 0.25, 0.1, 0.3]], np.float32)
HEADS = {"loc": np.zeros((1, 2, 4)), "logits": np.array([[[0, 5, 0], [9, 0, 0]]], float)}


def encoded(priors: list[list[float]]) -> str:
    return raw_metadata(np.array(priors), [])["objreg.priors"]


def raw(heads: Mapping[str, np.ndarray], metadata: Mapping[str, str], labels: int = 2) -> RawSsd:
    ports = tuple(Port(name, "float", (None,)) for name in heads)
    inputs = (Port("x", "uint8", (1, 30, 40, 3)),)
    contract = recognise(Graph(inputs, ports, metadata, heads, labels, "auto", (30, 40)))
    assert isinstance(contract, RawSsd)
    return contract


def test_raw_heads_become_the_priors_that_are_no_background() -> None:
    contract = raw(HEADS, raw_metadata(PRIORS, ["a", "b"]))
    answer = contract.read([HEADS[name] for name in contract.names], 0.5)
    assert answer.xyxy == pytest.approx(np.array([[0.4, 0.4, 0.6, 0.6]]), abs=1e-6)
    assert answer.index.tolist() == [0]
    assert answer.score == pytest.approx([np.exp(5) / (np.exp(5) + 2)])


def test_one_prior_may_give_two_labels_below_one_half() -> None:
    heads = {"loc": np.zeros((1, 2, 4)), "logits": np.array([[[0, 3, 3], [9, 0, 0]]], float)}
    contract = raw(heads, raw_metadata(PRIORS, ["a", "b"]))
    assert contract.read([heads[name] for name in contract.names], 0.3).index.tolist() == [0, 1]


@pytest.mark.parametrize("threshold", [0.0, 0.1, 0.5, 0.9])
def test_no_row_that_reaches_the_threshold_is_lost_to_the_shortcut(threshold: float) -> None:
    logits = np.random.default_rng(1).normal(0, 3, (1, 400, 4)).astype(np.float32)
    heads = {"loc": np.zeros((1, 400, 4), np.float32), "logits": logits}
    contract = raw(heads, raw_metadata(np.tile(PRIORS[:1], (400, 1)), ["a", "b", "c"]), labels=3)
    exponent = np.exp(logits[0])
    expected = (exponent[:, 1:] / exponent.sum(axis=1, keepdims=True) >= threshold).sum()
    assert len(contract.read([heads["loc"], logits], threshold).index) == expected


def test_priors_that_do_not_match_the_heads_are_refused() -> None:
    with pytest.raises(ValueError, match=r"from 1 priors and 2 labels, got loc \[1, 2, 4\]"):
        raw(HEADS, raw_metadata(PRIORS[:1], ["a", "b"]))


@pytest.mark.parametrize("rows", [1, 3])
def test_heads_of_another_size_of_picture_are_refused(rows: int) -> None:
    contract = raw(HEADS, raw_metadata(PRIORS, ["a", "b"]))
    with pytest.raises(ValueError, match=rf"expected a row for each of 2 priors, got \(1, {rows}\)"):
        contract.read([np.zeros((1, rows, 4)), np.zeros((1, rows, 3))], 0.5)


def test_fewer_labels_than_classes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected .*2 priors and 1 labels"):
        raw(HEADS, raw_metadata(PRIORS, ["a"]), labels=1)


@pytest.mark.parametrize(
    "changed",
    [
        {"objreg.contract": "ssd_raw/9"},
        {"objreg.priors": "no base64!"},
        {"objreg.priors": "AAAA"},
        {"objreg.priors": encoded([[0.5, 0.5, np.nan, 0.2], [0.5, 0.5, 0.2, 0.2]])},
        {"objreg.priors": encoded([[0.5, 0.5, 0.2, 0.2], [np.inf, 0.5, 0.2, 0.2]])},
        {"objreg.priors": encoded([[0.5, 0.5, 0.2, 0.2], [0.5, 0.5, 0.0, 0.2]])},
        {"objreg.variances": "[1, 2]"},
        {"objreg.variances": "[0.1, 0.1, NaN, 0.2]"},
        {"objreg.variances": "[0.1, 0.1, 0.2, Infinity]"},
        {"objreg.variances": "[0.1, 0.1, 0.2, 1e300]"},
        {"objreg.variances": "[0.1, 0.1, 0.2, -0.2]"},
        {"objreg.variances": f"[0.1, 0.1, 0.2, 1{'0' * 400}]"},
        {"objreg.variances": "[" * 100_000},
    ],
)
def test_metadata_of_another_kind_are_refused(changed: dict[str, str]) -> None:
    key = next(iter(changed))
    with pytest.raises(ValueError, match=f"{key}: expected|expected {key}") as refusal:
        raw(HEADS, raw_metadata(PRIORS, ["a", "b"]) | changed)
    assert len(str(refusal.value)) < 400 and "got" in str(refusal.value)


def test_raw_heads_without_metadata_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected objreg\.contract ssd_raw/1"):
        raw(HEADS, {})
